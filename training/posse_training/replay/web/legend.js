// The dialog with all keys and all that is drawn.
import { EVENTS, broken, colours, disc, faded, ghost, leader, line, pen, robot, target, tracker } from "./drawing.js";
import { pale } from "./robots.js";
import { app } from "./state.js";
import { button, element } from "./text.js";

const KEYS = [
  ["Space", "play or pause"],
  ["← →", "one step; with Shift, one second"],
  ["Home, End", "to the start, to the end"],
  ["N, B", "next tick, tick before"],
  ["0 to 9", "select a tracker; Esc: none"],
  ["F", "follow what is selected"],
  ["R", "show everything again (double click)"],
  ["wheel, drag", "zoom, move; on a touch screen pinch, drag"],
  ["L, S, T", "links, sensing, trails"],
];
const NOTE =
  "Score: slots occupied per working tracker, averaged over the steps so far. Safe score: from " +
  "the first contact on, every step counts 0. The curves show the last second; lead is the score " +
  "so far less that of the first player.";
const [X, Y] = [22, 13]; // the middle of a sample, px

const like = (fill, rim) => (ctx) => tracker(ctx, X, Y, 0, 8, fill, rim);

const dashed = (colour, dashes) => (ctx) => {
  pen(ctx, colour, 1.6, dashes);
  line(ctx, 4, Y, 42, Y);
};

const ring = (colour, fill, dashes) => (ctx) => {
  pen(ctx, colour, 1.6, dashes);
  disc(ctx, X, Y, 9);
  ctx.fillStyle = fill;
  if (fill) ctx.fill();
  ctx.stroke();
};

const outline = (colour, dashes) => (ctx) => {
  pen(ctx, colour, 1.6, dashes);
  robot(ctx, X, Y, 0, 8);
};

function samples() {
  const c = colours;
  const has = (name) => app.players.some((player) => player.columns.has(name));
  const [told, drifts] = [has("belief/task"), has("believed_x")];
  return [
    [like(c.TRACKER), told ? "tracker whose policy tells no task" : "tracker, its line ahead"],
    ...(told ? app.world.tasks.map((task, k) => [like(c.TASKS[k]), task]) : []),
    [like(pale(c.TRACKER)), "pale: it does not see the target"],
    [(ctx) => {
      like(c.BROKEN, c.TRACKER)(ctx);
      broken(ctx, X, Y, 7);
    }, "broken"],
    [(ctx) => leader(ctx, X, 17), "leader"],
    [(ctx) => target(ctx, X, Y, 0, 7), "target"],
    [ring(c.SLOT), "slot, as wide as the tolerance"],
    [ring(c.SLOT, c.SLOT_FILLED), "slot that is occupied"],
    [outline(c.TARGET, [4, 3]), "selected: its last fix of the target, where that is off; paler with age"],
    [outline(c.LINK, [1.5, 3]), "selected: where it takes the target to be"],
    [ring(c.SENSING_RIM, c.SENSING), "selected: where it would see the target"],
    [dashed(faded(c.INK, 0.6)), "selected: sonar beam that meets something"],
    [dashed(c.LINK), "radio: heard; selected: dashed and dated if it is old"],
    [dashed(faded(c.TARGET, 0.7), [2, 4]), "selected: the slot that it is bound for"],
    ...(drifts ? [[(ctx) => ghost(ctx, X, Y, 0, 8), "faint: where a tracker believes to be"]] : []),
    ...Object.values(EVENTS).map(({ draw, text }) => [(ctx) => draw(ctx, X, Y), `tick: ${text}`]),
  ];
}

function picture(draw) {
  const canvas = element("canvas");
  const ratio = devicePixelRatio || 1;
  [canvas.width, canvas.height] = [46 * ratio, 26 * ratio];
  const ctx = canvas.getContext("2d");
  ctx.scale(ratio, ratio);
  draw(ctx);
  return canvas;
}

export function toggleLegend() {
  const dialog = document.getElementById("legend");
  if (dialog.open) {
    dialog.close();
    return;
  }
  const rows = (all, tag, made) =>
    all.map(([first, text]) => element("tr", [element(tag, [made(first)]), element("td", text)]));
  dialog.replaceChildren(
    button("×", () => dialog.close(), "close"),
    element("h2", "Keys"),
    element("table", rows(KEYS, "th", (key) => element("kbd", key))),
    element("h2", "What is drawn"),
    element("table", rows(samples(), "td", picture), "drawn"),
    element("p", NOTE, "note"),
  );
  dialog.showModal();
}
