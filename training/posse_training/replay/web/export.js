// Pictures and films of what is seen: header, views and timeline on one canvas.
import { colours, write } from "./drawing.js";
import { app, listen, play, seconds, set } from "./state.js";
import { headline } from "./text.js";
import { drawTimeline, timelineHeight } from "./timeline.js";
import { drawView } from "./view.js";

const HEAD = 40;
const RATE = 30; // frames a second of a film
const TYPES = ["video/webm;codecs=vp9", "video/webm;codecs=vp8", "video/webm"];

let cameras = [];
let film = null; // {canvas, recorder} while one is recorded

function compose(target, ratio, note = "") {
  const boxes = cameras.map((camera) => camera.canvas.getBoundingClientRect());
  const left = Math.min(...boxes.map((box) => box.left));
  const top = Math.min(...boxes.map((box) => box.top));
  const width = Math.round(Math.max(...boxes.map((box) => box.right)) - left);
  const views = Math.round(Math.max(...boxes.map((box) => box.bottom)) - top);
  const strip = timelineHeight(width < 500);
  const size = [width, HEAD + views + strip].map((value) => 2 * Math.ceil((value * ratio) / 2));
  if (target.width !== size[0] || target.height !== size[1]) [target.width, target.height] = size;
  const ctx = target.getContext("2d");
  ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
  ctx.fillStyle = colours.PAPER;
  ctx.fillRect(0, 0, width, HEAD + views + strip);
  write(ctx, headline(), 12, HEAD / 2, 14, colours.INK, "left", 600);
  write(ctx, `${note}${seconds().toFixed(1)} s`, width - 12, HEAD / 2, 14, colours.INK, "right", 600);
  cameras.forEach((camera, k) => {
    ctx.save();
    ctx.translate(boxes[k].left - left, HEAD + boxes[k].top - top);
    drawView(ctx, camera.player, camera.look(app.position, cameras));
    ctx.restore();
  });
  ctx.translate(0, HEAD + views);
  drawTimeline(ctx, width, strip);
}

function save(blob, suffix) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  const names = app.players.map((player) => player.name).join("-");
  const name = `${names}-${app.world.scenario}-${app.world.world}-${seconds().toFixed(1)}s`;
  link.download = `${name.replace(/[^\w.-]+/g, "_").slice(0, 120)}.${suffix}`;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

export function savePicture() {
  const picture = document.createElement("canvas");
  compose(picture, 2);
  picture.toBlob((blob) => save(blob, "png"), "image/png");
}

// Records from the present moment to the end, or until it is asked for again.
export function toggleFilm() {
  if (film) {
    film.recorder.stop();
    return;
  }
  const type = globalThis.MediaRecorder && TYPES.find((one) => MediaRecorder.isTypeSupported(one));
  if (!type) {
    alert("This browser records no WebM films; use posse watch to write one.");
    return;
  }
  const canvas = document.createElement("canvas");
  compose(canvas, 1);
  const parts = [];
  const recorder = new MediaRecorder(canvas.captureStream(RATE), { mimeType: type, videoBitsPerSecond: 6e6 });
  recorder.ondataavailable = (part) => parts.push(part.data);
  recorder.onstop = () => {
    save(new Blob(parts, { type: "video/webm" }), "webm");
    film = null;
    set({ recording: false, playing: false });
  };
  recorder.start(500);
  film = { canvas, recorder };
  set({ recording: true });
  play(true);
}

// To be called once everything else is drawn.
export function filmFrame() {
  if (film) compose(film.canvas, 1, `${app.speed}× speed   `);
}

export function connectExport(all) {
  cameras = all;
  let wasPlaying = false;
  listen(() => {
    if (wasPlaying && !app.playing && film?.recorder.state === "recording") film.recorder.stop();
    wasPlaying = app.playing;
  });
}
