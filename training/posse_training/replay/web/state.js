// What the user has chosen: time, selection, layers. One object, and whoever wants to know of changes.

export const SPEEDS = [0.25, 0.5, 1, 2, 4, 8];

const LEAD_IN = 1; // s

export const app = {
  world: null,
  players: [],
  position: 0, // in frames, between two of them while it plays
  last: 0,
  playing: false,
  speed: 1,
  selected: null, // number of a robot; null: none
  layers: { links: true, sensing: true, trails: true },
  follow: false,
};

const listeners = [];

export function listen(listener) {
  listeners.push(listener);
}

export function set(changes) {
  Object.assign(app, changes);
  app.position = Math.max(0, Math.min(app.last, app.position));
  for (const listener of listeners) listener();
}

export function seconds(frames = app.position) {
  return frames * app.world.settings.control_step;
}

// Half the width and half the height of the arena, m; Infinity: the open plane.
export function halfSides({ arena }) {
  return [arena, arena].map((side, k) => (side[k] ?? side) / 2);
}

// The frame that a player is in; one whose episode has ended stays in its last.
export function frameOf(player, position = app.position) {
  return Math.min(Math.floor(position + 1e-6), player.last);
}

export function select(robot) {
  set({ selected: robot >= 0 && robot < app.world.agents ? robot : null });
}

// Start over at the end; pausing leaves no half frame behind.
export function play(playing = !app.playing) {
  const over = playing && app.position >= app.last;
  set({ playing, position: over ? 0 : playing ? app.position : Math.round(app.position) });
}

export function seek(position) {
  set({ position: Math.round(position), playing: false });
}

// A page opens playing, a little before the first event; still, where the user wants no motion or the address says when.
export function begin() {
  const steps = app.players.flatMap((player) => player.events.map((event) => event.step)).filter((step) => step > 0);
  const first = Math.max(0, Math.min(app.last, ...steps) - LEAD_IN / seconds(1));
  set({ position: steps.length ? first : 0, playing: !matchMedia("(prefers-reduced-motion: reduce)").matches });
}

// --- the address: #t=12.4&r=3 ---

export function readHash(hash = location.hash) {
  const asked = new URLSearchParams(hash.slice(1));
  const time = Number(asked.get("t") ?? NaN);
  if (Number.isFinite(time)) seek(time / seconds(1));
  if (asked.has("r")) select(Number.parseInt(asked.get("r"), 10));
}

export function writeHash() {
  if (app.playing) return;
  const robot = app.selected === null ? "" : `&r=${app.selected}`;
  const hash = `#t=${Number(seconds().toFixed(3))}${robot}`;
  if (hash === location.hash) return;
  try {
    history.replaceState(null, "", hash);
  } catch {
    // Where the page is shown inside another, its address may be out of reach.
  }
}
