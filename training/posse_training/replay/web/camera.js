// Where each view looks: world metres to pixels.
// What it shows by itself is a function of the moment alone, so that seeking and playing agree.
import { app } from "./state.js";

const MARGIN = 0.7; // m, between the outermost robot and the edge
const WALL = 0.3; // m, shown outside the walls
const LEAST_SPAN = 7; // m, across the shorter side
const CALM = 1.5; // s, over which the view of an open plane is evened out

export const TITLE = 34; // px above the picture
export const FOOT = 24; // px below it

// The greatest value within `reach` of each place, then the mean over as much: it lies nowhere
// below the value, and moves smoothly.
function envelope(values, reach) {
  const most = values.map((_, k) =>
    Math.max(...values.slice(Math.max(0, k - reach), k + reach + 1)),
  );
  return most.map((_, k) => {
    const part = most.slice(Math.max(0, k - reach), k + reach + 1);
    return part.reduce((sum, value) => sum + value, 0) / part.length;
  });
}

// The box that holds the working robots, frame by frame: [-left, -bottom, right, top].
// It reaches no farther than the walls.
function boxes(player) {
  const { num_trackers: n, arena, control_step: step } = app.world.settings;
  const column = (name) => player.columns.get(name);
  const [xs, ys] = [column("tracker_x"), column("tracker_y")];
  const edges = [[], [], [], []];
  for (let frame = 0; frame < player.frames; frame++) {
    let [tx, ty] = [column("target_x").at(frame), column("target_y").at(frame)];
    const box = [-tx, -ty, tx, ty];
    for (let i = 0; i < n; i++) {
      if (column("tracker_broken").at(frame, i)) continue;
      [tx, ty] = [xs.at(frame, i), ys.at(frame, i)];
      [-tx, -ty, tx, ty].forEach((value, k) => (box[k] = Math.max(box[k], value)));
    }
    box.forEach((value, k) => edges[k].push(Math.min(value + MARGIN, arena / 2 + WALL)));
  }
  const reach = Math.round(CALM / step);
  return edges.map((values) => envelope(values, reach));
}

export class Camera {
  constructor(player) {
    this.player = player;
    this.edges = boxes(player);
    this.free = null; // {x, y, zoom} once the user has moved it; zoom: as a share of the own one
    this.width = this.height = 1;
  }

  resize(width, height) {
    this.width = width;
    this.height = height;
  }

  // The middle and the scale that show everything.
  own(position) {
    const room = [this.width - 12, this.height - TITLE - FOOT];
    const at = (k) => {
      const frame = Math.min(Math.floor(position), this.player.last);
      const next = Math.min(frame + 1, this.player.last);
      const share = Math.min(position - frame, 1);
      return this.edges[k][frame] * (1 - share) + this.edges[k][next] * share;
    };
    const [left, bottom, right, top] = [-at(0), -at(1), at(2), at(3)];
    const least = LEAST_SPAN / Math.min(...room);
    const needed = Math.max(least, (right - left) / room[0], (top - bottom) / room[1]);
    return { x: (left + right) / 2, y: (bottom + top) / 2, scale: 1 / needed };
  }

  // What to draw with: project and unproject between metres and pixels.
  look(position, others) {
    const own = this.own(position);
    let { x, y, scale } = own;
    if (app.linked) scale = Math.min(...others.map((camera) => camera.own(position).scale));
    if (this.free) {
      scale = this.free.scale;
      [x, y] = [this.free.x, this.free.y];
    }
    if (app.follow) {
      const { columns } = this.player;
      const n = app.world.settings.num_trackers;
      const robot = app.selected ?? n;
      const at = Math.min(position, this.player.last);
      const name = robot < n ? "tracker" : "target";
      x = columns.get(`${name}_x`).between(at, robot % n);
      y = columns.get(`${name}_y`).between(at, robot % n);
      if (!this.free) scale = Math.max(scale, Math.min(this.width, this.height) / 12);
    }
    const [cx, cy] = [this.width / 2, (this.height + TITLE - FOOT) / 2];
    return {
      x,
      y,
      scale,
      width: this.width,
      height: this.height,
      project: (px, py) => [cx + (px - x) * scale, cy - (py - y) * scale],
      unproject: (px, py) => [x + (px - cx) / scale, y - (py - cy) / scale],
    };
  }
}

// Zoom about a pixel and move by pixels, in one view or, where they are linked, in all.
export function moveCameras(cameras, moved, factor, about, dx, dy) {
  const looks = cameras.map((camera) => camera.look(app.position, cameras));
  cameras.forEach((camera, k) => {
    if (camera !== moved && !app.linked) return;
    const look = looks[k];
    const scale = Math.max(2, Math.min(2000, look.scale * factor));
    const [wx, wy] = look.unproject(...about);
    const kept = look.scale / scale;
    camera.free = {
      x: wx + (look.x - wx) * kept - dx / scale,
      y: wy + (look.y - wy) * kept + dy / scale,
      scale,
    };
  });
}

export function fitCameras(cameras) {
  for (const camera of cameras) camera.free = null;
}

