// Buttons, keys, pointers.
import { moveCameras } from "./camera.js";
import { toggleLegend } from "./legend.js";
import { SPEEDS, app, listen, play, seconds, seek, select, set } from "./state.js";
import { robotAt } from "./view.js";

const PLAY = "M7 4.500v15L20 12z";
const PAUSE = "M6 5h4v14H6zM14 5h4v14h-4z";
const TAP = 6; // px; a pointer that moves less means a click

const by = (id) => document.getElementById(id);

function toggleLayer(name) {
  set({ layers: { ...app.layers, [name]: !app.layers[name] } });
}

function jump(direction) {
  const steps = app.players.flatMap((player) => player.events.map((event) => event.step));
  const ahead = steps.filter((step) => (step - app.position) * direction > 0.5);
  if (ahead.length) seek(direction > 0 ? Math.min(...ahead) : Math.max(...ahead));
}

function fit(cameras) {
  for (const camera of cameras) camera.free = null;
  set({ follow: false });
}

export function connectControls(cameras) {
  const second = Math.max(1, Math.round(1 / seconds(1)));
  const actions = {
    start: () => seek(0),
    back: () => seek(app.position - 1),
    play: () => play(),
    forth: () => seek(app.position + 1),
    follow: () => set({ follow: !app.follow }),
    fit: () => fit(cameras),
    links: () => toggleLayer("links"),
    sensing: () => toggleLayer("sensing"),
    trails: () => toggleLayer("trails"),
    help: toggleLegend,
    more: () => {
      document.body.classList.toggle("no-panel");
      dispatchEvent(new Event("resize"));
      set({});
    },
  };
  for (const [id, act] of Object.entries(actions)) by(id).addEventListener("click", act);
  for (const speed of SPEEDS) by("speed").append(new Option(`${speed}×`, speed));
  by("speed").addEventListener("change", (event) => set({ speed: Number(event.target.value) }));

  const keys = {
    " ": actions.play,
    ArrowLeft: (shift) => seek(app.position - (shift ? second : 1)),
    ArrowRight: (shift) => seek(app.position + (shift ? second : 1)),
    Home: actions.start,
    End: () => seek(app.last),
    Escape: () => select(null),
    n: () => jump(1),
    b: () => jump(-1),
    f: actions.follow,
    r: actions.fit,
    l: actions.links,
    s: actions.sensing,
    t: actions.trails,
    "?": toggleLegend,
  };
  addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (by("legend").open && key !== "?") return;
    if (event.target.tagName === "SELECT" && key.startsWith("Arrow")) return;
    const act = /^\d$/.test(key) ? () => select(Number(key)) : keys[key];
    if (!act) return;
    event.preventDefault();
    act(event.shiftKey);
  });
  listen(() => {
    by("playing").setAttribute("d", app.playing ? PAUSE : PLAY);
    by("clock").textContent = `${seconds().toFixed(1)} / ${seconds(app.last).toFixed(1)} s`;
    by("speed").value = String(app.speed);
    const pressed = { ...app.layers, follow: app.follow };
    for (const [id, on] of Object.entries(pressed)) by(id).setAttribute("aria-pressed", on);
  });
}

// Drag, wheel, pinch, tap and double click in one view.
export function connectView(camera, cameras, redraw) {
  const { canvas } = camera;
  const pointers = new Map();
  let travelled = 0;
  const place = (event) => {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.x, event.clientY - box.y];
  };
  const robotBelow = (event) => robotAt(camera.player, camera.look(app.position, cameras), ...place(event));
  const spread = () => {
    const [a, b] = [...pointers.values()];
    return { middle: [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2], apart: Math.hypot(a[0] - b[0], a[1] - b[1]) };
  };
  const move = (factor, about, dx, dy) => {
    if (app.follow && (dx || dy)) set({ follow: false });
    moveCameras(cameras, factor, about, dx, dy);
    redraw();
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, place(event));
    if (pointers.size === 1) travelled = 0;
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (!before) {
      canvas.style.cursor = robotBelow(event) === null ? "grab" : "pointer";
      return;
    }
    const now = place(event);
    const pinch = pointers.size === 2 ? spread() : null;
    pointers.set(event.pointerId, now);
    travelled += Math.hypot(now[0] - before[0], now[1] - before[1]);
    if (pinch) {
      const { middle, apart } = spread();
      const [dx, dy] = [middle[0] - pinch.middle[0], middle[1] - pinch.middle[1]];
      move(apart / Math.max(1, pinch.apart), middle, dx, dy);
    } else if (travelled > TAP) {
      move(1, now, now[0] - before[0], now[1] - before[1]);
    }
  });
  for (const end of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(end, (event) => {
      const tapped = pointers.size === 1 && travelled <= TAP && end === "pointerup";
      pointers.delete(event.pointerId);
      const found = tapped ? robotBelow(event) : null;
      if (found !== null) select(found === app.selected ? null : found);
    });
  }
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    move(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0016)), place(event), 0, 0);
  }, { passive: false });
  canvas.addEventListener("dblclick", () => fit(cameras));
}
