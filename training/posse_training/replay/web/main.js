// Puts the page together, and draws it whenever something has changed.
import { Camera } from "./camera.js";
import { connectControls, connectView } from "./controls.js";
import { readReplay } from "./data.js";
import { connectPanel } from "./panel.js";
import { sightOf } from "./sensing.js";
import { app, begin, listen, readHash, seconds, set, writeHash } from "./state.js";
import { fillHeader } from "./text.js";
import { connectTimeline, drawTimeline, timelineHeight } from "./timeline.js";
import { drawView } from "./view.js";

const SETTLES = 250; // ms without a change before the address is written

// Makes a canvas as large as its place, in the screen's own pixels.
function fill(canvas, box) {
  const ratio = Math.min(devicePixelRatio || 1, 3);
  const size = [Math.round(box.width * ratio), Math.round(box.height * ratio)];
  if (canvas.width !== size[0] || canvas.height !== size[1]) [canvas.width, canvas.height] = size;
  const ctx = canvas.getContext("2d");
  ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
  return ctx;
}

function start() {
  const views = document.getElementById("views");
  const strip = document.getElementById("timeline");
  const cameras = app.players.map((player) => {
    const canvas = document.createElement("canvas");
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `${player.name} at work`);
    const holder = document.createElement("div");
    holder.append(canvas);
    views.append(holder);
    return new Camera(player, canvas);
  });
  views.dataset.players = cameras.length;
  document.body.style.setProperty("--count", cameras.length);

  let waiting = false;
  let before = null;
  let hover = null;
  let timer = 0;

  const draw = () => {
    for (const camera of cameras) {
      ({ width: camera.width, height: camera.height } = camera.canvas.parentElement.getBoundingClientRect());
    }
    for (const camera of cameras) {
      drawView(fill(camera.canvas, camera), camera.player, camera.look(app.position, cameras));
    }
    const box = strip.getBoundingClientRect();
    drawTimeline(fill(strip.firstElementChild, box), box.width, box.height, hover);
  };
  const tick = (now) => {
    waiting = false;
    const passed = before === null ? 0 : Math.min(0.25, (now - before) / 1000);
    before = app.playing ? now : null;
    if (app.playing) {
      const position = app.position + (passed * app.speed) / seconds(1);
      set({ position, playing: position < app.last });
    }
    draw();
    if (app.playing) redraw();
  };
  const redraw = () => {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(tick);
  };

  listen(() => {
    strip.setAttribute("aria-valuenow", seconds().toFixed(1));
    strip.setAttribute("aria-valuemax", seconds(app.last).toFixed(1));
    clearTimeout(timer);
    timer = setTimeout(writeHash, SETTLES);
    redraw();
  });
  fillHeader();
  connectControls(cameras);
  connectPanel();
  connectTimeline(strip, (at) => {
    hover = at;
    redraw();
  });
  for (const camera of cameras) connectView(camera, cameras, redraw);
  const narrow = matchMedia("(max-width: 760px), (max-height: 480px)");
  const arrange = () => {
    strip.style.height = `${timelineHeight(narrow.matches)}px`;
    redraw();
  };
  new ResizeObserver(arrange).observe(views);
  addEventListener("resize", arrange);
  // What was asked for: the address itself may have been written again since.
  addEventListener("hashchange", ({ newURL }) => readHash(new URL(newURL).hash));
  const framed = self !== top; // by another page, which has words of its own
  document.body.classList.toggle("framed", framed);
  document.body.classList.toggle("no-panel", framed || narrow.matches);
  set({});
  arrange();
  begin();
  readHash();
  return cameras;
}

// For scripts and tests: window.replay.set({ position: 10 }), window.replay.app.players, ...
async function main() {
  try {
    Object.assign(app, await readReplay());
    const cameras = start();
    const look = (k) => cameras[k].look(app.position, cameras);
    globalThis.replay = { app, set, look, sightOf };
    document.documentElement.dataset.ready = "yes";
  } catch (error) {
    const message = document.getElementById("message");
    message.textContent = `This replay cannot be shown, or needs a newer browser: ${error.message}`;
    message.hidden = false;
    throw error;
  }
}

main();
