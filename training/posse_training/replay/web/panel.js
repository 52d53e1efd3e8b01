// Beside the pictures: all numbers of the selected robot, the players abreast.
import { colours } from "./drawing.js";
import { app, frameOf, listen, seconds, seek, select } from "./state.js";
import { button, element, number, setting, words } from "./text.js";

const OPEN = new Set(["episode", "action", "reward", "target", "belief"]);
const BELIEFS = { estimate: "m, m, rad", estimate_age: "s" };
const FLAGS = { tracker_broken: "broken", tracker_sensor_dead: "no sensor", tracker_radio_dead: "no radio" };
let cells = []; // functions that write a cell's text at the present moment

// A row with a value for each player: value(player, frame) is a text; null: not known, shown as `none`.
function row(name, unit, value, { title = "", none = "–" } = {}) {
  const made = element("tr", [element("th", name), element("td", ["1", "count"].includes(unit) ? "" : unit, "unit")]);
  made.title = title;
  for (const player of app.players) {
    const cell = element("td");
    made.append(cell);
    cells.push(() => {
      const text = value(player, frameOf(player));
      if (cell.textContent !== (text ?? none)) cell.textContent = text ?? none;
      cell.classList.toggle("unknown", text === null);
    });
  }
  return made;
}

function headingRow(text) {
  return element("tr", [element("th", text)], "heading");
}

function show() {
  for (const cell of cells) cell();
}

function section(name, rows, heading = name) {
  const made = element("details", [element("summary", heading), element("table", rows)]);
  made.open = OPEN.has(name);
  made.addEventListener("toggle", () => (made.open ? OPEN.add(name) : OPEN.delete(name)));
  return made;
}

function metrics() {
  const whole = app.world.metrics.map(({ name, unit, meaning }) =>
    row(words(name), unit, ({ metrics: { [name]: value } }) =>
      Number.isFinite(value) ? number(value, { count: 0, s: 1 }[unit] ?? 3) : null,
    { title: meaning, none: "never" }),
  );
  return section("episode", [
    row("score so far", "1", (player, frame) => number(player.scores[frame].mean, 3)),
    row("safe score so far", "1", (player, frame) => number(player.scores[frame].safe, 3)),
    headingRow("in the whole episode"),
    ...whole,
  ]);
}

function condition(robot) {
  const of = (player, name, frame) => player.columns.get(name).at(frame, robot);
  return element("table", [
    row("condition", "1", (player, frame) =>
      Object.keys(FLAGS).filter((name) => of(player, name, frame)).map((name) => FLAGS[name]).join(", ") || "works"),
    row("slot occupied", "1", (player, frame) => {
      const slot = of(player, "tracker_slot", frame);
      return slot < 0 ? "none" : number(slot, 0);
    }),
    row("sees the target", "1", (player, frame) => (of(player, "tracker_sees", frame) ? "yes" : "no")),
    row("last fix", "s", (player, frame) => {
      const step = of(player, "tracker_fix_step", frame);
      return step < 0 ? null : `${number(seconds(frame - step), 1)} ago`;
    }, { none: "not known" }),
  ]);
}

// `size` numbers of a column, from one on.
function values(column, frame, start, size) {
  return Array.from({ length: size }, (_, k) => column.at(frame, start + k));
}

// An action is in [-1, 1].
function actions(robot) {
  const s = app.world.settings;
  const [speed, turn] = robot === s.num_trackers
    ? [s.target_speed, s.target_turn_rate]
    : [s.tracker_speed, s.tracker_turn_rate].map((limit) => limit[robot] ?? limit); // of each, or of all
  const action = (player, frame) => values(player.columns.get("action"), frame, 2 * robot, 2);
  return section("action", [
    row("speed", "m/s", (player, frame) => number(((action(player, frame)[0] + 1) / 2) * speed),
      { title: "asked for in this step" }),
    row("turn rate", "rad/s", (player, frame) => number(action(player, frame)[1] * turn),
      { title: "asked for in this step, left positive" }),
  ]);
}

function rewards(robot) {
  const { terms, settings: { reward_weights: weights } } = app.world;
  const term = (player, name, frame) => player.columns.get(`reward/${name}`)?.at(frame, robot) ?? 0;
  const rows = terms.map(({ name, unit, meaning }) =>
    row(`${words(name)} × ${setting(weights[name])}`, unit, (player, frame) =>
      number(term(player, name, frame), unit === "m" ? 3 : 0), { title: meaning }),
  );
  const total = (player, frame) =>
    terms.reduce((sum, { name }) => sum + weights[name] * term(player, name, frame), 0);
  return section("reward", [...rows, row("reward", "1", (player, frame) => number(total(player, frame), 3))]);
}

function believed(robot) {
  const names = app.players.flatMap((player) => [...player.columns.keys()]).filter((name) => name.startsWith("belief/"));
  const rows = [...new Set(names)].map((key) => {
    const name = key.slice("belief/".length);
    return row(words(name), BELIEFS[name] ?? "1", (player, frame) => {
      const column = player.columns.get(key);
      if (!column) return null;
      const size = column.size / column.shape[0];
      const told = values(column, frame, robot * size, size);
      const age = player.columns.get(`${key}_age`); // negative: there is none
      if ((size === 1 && told[0] < 0) || age?.at(frame, robot) < 0) return "none";
      if (name === "task") return app.world.tasks[told[0]];
      return told.map((value) => number(value, column.scale === 1 ? 0 : 2)).join(" ");
    }, { none: "not told" });
  });
  return rows.length ? [section("belief", rows, "what it believes")] : [];
}

// "Not known" is what the field says stands for it; where that is 0, its block has to agree.
function isKnown(player, field, frame, robot, place, found) {
  if (field.unknown === null || found.some((value) => value !== field.unknown)) return true;
  if (field.unknown !== 0) return false;
  if (field.block === "target") return player.columns.get("observation/target_known")?.at(frame, robot) === 1;
  const mates = player.columns.get("observation/neighbour_number");
  return field.block === "team-mates" && mates.at(frame, (robot * mates.size) / mates.shape[0] + place) >= 0;
}

function fieldRow(field, robot, place = 0) {
  return row(words(field.name.replace(/^neighbour_/, "")), field.unit, (player, frame) => {
    const column = player.columns.get(`observation/${field.name}`);
    if (!column) return null;
    const places = field.block === "team-mates" ? column.shape[1] : 1;
    const size = column.size / (column.shape[0] * places); // a message's is each policy's own
    const found = values(column, frame, (robot * places + place) * size, size);
    if (!isKnown(player, field, frame, robot, place, found)) return null;
    const digits = column.scale === 1 ? 0 : size > 3 ? 1 : 2;
    return found.map((value) => number(value, digits)).join("  ");
  }, { title: field.meaning, none: "not known" });
}

function observation(robot) {
  const made = [...new Set(app.world.fields.map((field) => field.block))].map((block) => {
    const fields = app.world.fields.filter((field) => field.block === block);
    const rows = [];
    if (block === "team-mates") {
      const places = app.players.map(({ columns }) => {
        const mates = columns.get("observation/neighbour_number");
        return mates ? mates.size / mates.shape[0] : 0;
      });
      for (let place = 0; place < Math.max(...places); place++) {
        rows.push(headingRow(`place ${place + 1}, nearest first`));
        rows.push(...fields.map((field) => fieldRow(field, robot, place)));
      }
    } else {
      rows.push(...fields.map((field) => fieldRow(field, robot)));
    }
    return section(block, rows, `observed: ${block}`);
  });
  if (made.length > 1) return made;
  return [...made, element("p", "This page was written without the observations.", "note")];
}

function eventList() {
  const items = app.players.flatMap((player) => player.events.map((event) => ({ player, event })));
  items.sort((a, b) => a.event.step - b.event.step);
  const rows = items.slice(0, 300).map(({ player, event }) => {
    const jump = button(`${seconds(event.step).toFixed(1)} s`, () => seek(event.step), "jump");
    const made = element("tr", [element("td", [jump]), element("td", event.text)]);
    made.style.boxShadow = `inset 3px 0 ${colours.PLAYERS[player.number]}`;
    return made;
  });
  return section("events", rows, `events (${items.length})`);
}

function cards() {
  const told = app.players.filter((player) => Object.keys(player.about).length);
  const made = told.flatMap((player) => {
    const rows = Object.entries(player.about).map(([name, value]) =>
      element("tr", [element("th", words(name)), element("td", String(value), "long")]),
    );
    return [element("h3", player.name), element("table", rows)];
  });
  return made.length ? [element("details", [element("summary", "policies"), ...made])] : [];
}

function heading(robot) {
  const names = app.players.map((player) => {
    const name = element("td", player.name, "player");
    name.style.borderTopColor = colours.PLAYERS[player.number];
    return name;
  });
  const title = robot === app.world.settings.num_trackers ? "target" : `tracker ${robot}`;
  const chosen = robot === null ? ["No robot selected"] : [title, button("×", () => select(null))];
  const row = element("tr", [element("th"), element("td", "", "unit"), ...names]);
  return element("div", [element("h2", chosen), element("table", [row])], "top");
}

function build(robot) {
  cells = [];
  const parts = [heading(robot)];
  if (robot === null) {
    parts.push(element("p", "Choose one in a picture, or with the keys 0 to 9.", "note"));
  } else {
    const isTracker = robot < app.world.settings.num_trackers;
    if (isTracker) parts.push(condition(robot));
    parts.push(actions(robot), rewards(robot), ...(isTracker ? believed(robot) : []), ...observation(robot));
  }
  document.getElementById("panel").replaceChildren(...parts, metrics(), eventList(), ...cards());
}

export function connectPanel() {
  let [built, shown] = [undefined, undefined];
  listen(() => {
    if (app.selected !== built) {
      built = app.selected;
      shown = undefined;
      build(built);
    }
    const frame = Math.floor(app.position + 1e-6);
    if (frame !== shown && !document.body.classList.contains("no-panel")) {
      shown = frame;
      show();
    }
  });
}
