// Beside the pictures: all numbers of the selected robot, the players abreast.
import { colours } from "./colours.js";
import { app, frameOf, listen, robotName, seconds, seek, select } from "./state.js";
import { button, element, number, setting, unit, words } from "./values.js";
import { scoresOf } from "./view.js";

const OPEN = new Set(["episode", "action", "reward", "target", "belief"]);
const DIGITS = { count: 0, s: 1 };
const BELIEFS = { estimate: "m, m, rad", estimate_age: "s" };
let cells = []; // {element, update(frame, player)}
let built = ""; // what the rows were made for

const panel = () => document.getElementById("panel");

// A row with a value for each player; value(player, frame) -> [text, known].
function row(name, units, value, title = "") {
  const made = element("tr", [element("th", name), element("td", unit(units), "unit")]);
  if (title) made.title = title;
  for (const player of app.players) {
    const cell = element("td");
    made.append(cell);
    cells.push({
      show() {
        const [text, known] = value(player, frameOf(player));
        if (cell.textContent !== text) cell.textContent = text;
        cell.classList.toggle("unknown", !known);
      },
    });
  }
  return made;
}

function section(name, rows, heading = name) {
  const made = element("details");
  made.open = OPEN.has(name);
  made.addEventListener("toggle", () => {
    if (made.open) OPEN.add(name);
    else OPEN.delete(name);
    show();
  });
  made.append(element("summary", heading), element("table", rows));
  return made;
}

function metrics() {
  const live = [
    row("score so far", "1", (player, frame) => [number(scoresOf(player)[frame].mean, 3), true]),
    row("safe score so far", "1", (player, frame) => [
      number(scoresOf(player)[frame].safe, 3), true,
    ]),
  ];
  const whole = app.world.metrics.map((metric) =>
    row(words(metric.name), metric.unit, (player) => {
      const value = player.metrics[metric.name];
      const known = Number.isFinite(value);
      return [known ? number(value, DIGITS[metric.unit] ?? 3) : "never", known];
    }, metric.meaning),
  );
  const line = element("tr", [element("th", "in the whole episode")], "heading");
  return section("episode", [...live, line, ...whole]);
}

function condition(robot) {
  const n = app.world.settings.num_trackers;
  const flags = [
    ["tracker_broken", "broken"], ["tracker_sensor_dead", "no sensor"],
    ["tracker_radio_dead", "no radio"],
  ];
  const of = (text) => (player, frame) => [text(player.columns, frame), true];
  const rows = robot < n ? [
    row("condition", "1", of((columns, frame) =>
      flags.filter(([name]) => columns.get(name).at(frame, robot)).map(([, text]) => text)
        .join(", ") || "works")),
    row("slot occupied", "1", of((columns, frame) => {
      const slot = columns.get("tracker_slot").at(frame, robot);
      return slot < 0 ? "none" : number(slot, 0);
    })),
    row("sees the target", "1", of((columns, frame) =>
      columns.get("tracker_sees").at(frame, robot) ? "yes" : "no")),
    row("last fix", "s", (player, frame) => {
      const step = player.columns.get("tracker_fix_step").at(frame, robot);
      return step < 0 ? ["not known", false] : [`${number(seconds(frame - step), 1)} ago`, true];
    }),
  ] : [];
  return element("table", rows);
}

// An action is in [-1, 1]; beside it, what it asks for.
function actions(robot) {
  const s = app.world.settings;
  const isTarget = robot === s.num_trackers;
  const [speed, turn] = isTarget
    ? [s.target_speed, s.target_turn_rate]
    : [s.tracker_speed, s.tracker_turn_rate];
  const asked = (k, physical) => (player, frame) => {
    const action = player.columns.get("action");
    return action ? [number(physical(action.at(frame, 2 * robot + k))), true] : ["–", false];
  };
  const rows = [
    row("speed", "m/s", asked(0, (a) => ((a + 1) / 2) * speed), "asked for in this step"),
    row("turn rate", "rad/s", asked(1, (a) => a * turn), "asked for in this step, left positive"),
    row("as numbers", "1", (player, frame) => {
      const action = player.columns.get("action");
      if (!action) return ["–", false];
      return [[0, 1].map((k) => number(action.at(frame, 2 * robot + k))).join("  "), true];
    }),
  ];
  if (app.players.some((player) => player.columns.has("message"))) {
    rows.push(row("message", "1", (player, frame) => {
      const message = player.columns.get("message");
      if (!message) return ["none", false];
      const m = message.shape[1];
      return [Array.from({ length: m }, (_, k) =>
        number(message.at(frame, m * robot + k), 3)).join(" "), true];
    }));
  }
  return section("action", rows);
}

function rewards(robot) {
  const { weights, terms } = app.world;
  const term = (player, name, frame) =>
    player.columns.get(`reward/${name}`)?.at(frame, robot) ?? 0;
  const rows = terms.map(({ name, unit: units, meaning }) =>
    row(`${words(name)} × ${setting(weights[name])}`, units, (player, frame) => [
      number(term(player, name, frame), units === "m" ? 3 : 0), true,
    ], meaning),
  );
  const total = (player, frame) =>
    terms.reduce((sum, { name }) => sum + weights[name] * term(player, name, frame), 0);
  rows.push(row("reward", "1", (player, frame) => [number(total(player, frame), 3), true]));
  return section("reward", rows);
}

function vector(column, frame, start, size) {
  return Array.from({ length: size }, (_, k) => {
    const value = column.at(frame, start + k);
    return number(value, column.scale === 1 ? 0 : 2);
  });
}

function beliefRows(robot) {
  const names = new Set();
  for (const player of app.players) {
    for (const name of player.columns.keys()) {
      if (name.startsWith("belief/")) names.add(name.slice(7));
    }
  }
  return [...names].map((name) =>
    row(words(name), BELIEFS[name] ?? "1", (player, frame) => {
      const column = player.columns.get(`belief/${name}`);
      if (!column) return ["not told", false];
      const size = column.size / column.shape[0];
      const values = vector(column, frame, robot * size, size);
      const first = column.at(frame, robot * size);
      const age = player.columns.get(`belief/${name}_age`); // negative: there is none
      if ((size === 1 && first < 0) || age?.at(frame, robot) < 0) return ["none", false];
      if (name === "task") return [app.world.tasks[first] ?? values[0], true];
      return [values.join(" "), true];
    }),
  );
}

// "Not known" is what the field says stands for it; where that is 0, its block has to agree.
function isKnown(player, field, frame, robot, place, values) {
  if (field.unknown === null || values.some((value) => value !== field.unknown)) return true;
  if (field.unknown !== 0) return false;
  const of = (name, k) => player.columns.get(`observation/${name}`)?.at(frame, k);
  if (field.block === "target") return of("target_known", robot) === 1;
  if (field.block === "team-mates") {
    const places = player.columns.get("observation/neighbour_number").shape[1] ?? 1;
    return of("neighbour_number", robot * places + place) >= 0;
  }
  return false;
}

function fieldRow(field, robot, place = 0) {
  return row(words(field.name.replace(/^neighbour_/, "")), field.unit, (player, frame) => {
    const column = player.columns.get(`observation/${field.name}`);
    if (!column) return ["–", false];
    const each = column.size / column.shape[0];
    const start = robot * each + place * field.size;
    const raw = Array.from({ length: field.size }, (_, k) => column.at(frame, start + k));
    const known = isKnown(player, field, frame, robot, place, raw);
    const digits = column.scale === 1 ? 0 : field.size > 3 ? 1 : 2;
    const text = raw.map((value) => number(value, digits)).join("  ");
    return [known ? text : "not known", known];
  }, field.meaning);
}

function observation(robot) {
  const kept = app.world.fields.filter((field) =>
    app.players.some((player) => player.columns.has(`observation/${field.name}`)),
  );
  const made = [];
  for (const block of [...new Set(kept.map((field) => field.block))]) {
    const fields = kept.filter((field) => field.block === block);
    if (block !== "team-mates") {
      made.push(section(block, fields.map((field) => fieldRow(field, robot)), `observed: ${block}`));
      continue;
    }
    const places = app.players.map((player) => {
      const column = player.columns.get("observation/neighbour_number");
      return column ? column.size / column.shape[0] : 0;
    });
    const rows = [];
    for (let place = 0; place < Math.max(...places); place++) {
      rows.push(element("tr", [element("th", `place ${place + 1}, nearest first`)], "heading"));
      rows.push(...fields.map((field) => fieldRow(field, robot, place)));
    }
    made.push(section(block, rows, "observed: team-mates"));
  }
  if (!made.some((one) => one.querySelectorAll("tr").length > 2)) {
    made.push(element("p", "This page was written without the observations.", "note"));
  }
  return made;
}

function eventList() {
  const items = app.players.flatMap((player) => player.events.map((event) => ({ player, event })));
  items.sort((a, b) => a.event.step - b.event.step);
  const rows = items.slice(0, 300).map(({ player, event }) => {
    const jump = button(`${seconds(event.step).toFixed(1)} s`, () => seek(event.step), "jump");
    const text = element("td", event.text);
    const made = element("tr", [element("td", [jump]), text]);
    made.style.boxShadow = `inset 3px 0 ${colours.PLAYERS[player.number]}`;
    return made;
  });
  return section("events", rows, `events (${items.length})`);
}

function cards() {
  const made = app.players.map((player) => {
    const rows = Object.entries(player.about).map(([name, value]) =>
      element("tr", [element("th", words(name)), element("td", String(value), "long")]),
    );
    return rows.length ? [element("h3", player.name), element("table", rows)] : [];
  });
  if (made.every((one) => !one.length)) return [];
  const section = element("details", [element("summary", "policies"), ...made.flat()]);
  return [section];
}

function heading(robot) {
  const names = app.players.map((player) => {
    const name = element("td", player.name, "player");
    name.style.borderTopColor = colours.PLAYERS[player.number];
    return name;
  });
  const close = button("×", () => select(null));
  close.title = "Select none (Esc)";
  const title = robot === null ? "No robot selected" : robotName(robot);
  const chosen = element("h2", [title, ...(robot === null ? [] : [close])]);
  const table = element("table", [
    element("tr", [element("th"), element("td", "", "unit"), ...names]),
  ]);
  return element("div", [chosen, table], "top");
}

function build() {
  const robot = app.selected;
  cells = [];
  const parts = [heading(robot)];
  if (robot === null) {
    parts.push(element("p", "Choose one in a picture, or with the keys 0 to 9.", "note"));
  } else {
    parts.push(condition(robot), actions(robot), rewards(robot));
    const believed = robot < app.world.settings.num_trackers ? beliefRows(robot) : [];
    if (believed.length) parts.push(section("belief", believed, "what it believes"));
    parts.push(...observation(robot));
  }
  parts.push(metrics(), eventList(), ...cards());
  panel().replaceChildren(...parts);
}

let shown = "";

function show() {
  for (const cell of cells) cell.show();
}

export function connectPanel() {
  listen(() => {
    const wanted = String(app.selected);
    if (wanted !== built) {
      build();
      built = wanted;
      shown = "";
    }
    const frame = `${built} ${Math.floor(app.position + 1e-6)}`;
    if (frame !== shown && !document.body.classList.contains("no-panel")) {
      shown = frame;
      show();
    }
  });
}
