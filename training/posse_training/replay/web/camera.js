// Where each view looks: world metres to pixels.
// What it shows by itself is a function of the moment alone, so that seeking and playing agree.
import { app, halfSides } from "./state.js";

const MARGIN = 0.7; // m, between the outermost robot and the edge
const WALL = 0.3; // m, shown outside the walls
const LEAST_SPAN = 7; // m, across the shorter side
const CALM = 1.5; // s, over which the view of an open plane is evened out

export const TITLE = 34; // px above the picture
export const FOOT = 24; // px below it

// The greatest value within `reach` of each place, then the mean over as much: it lies nowhere
// below the value, and moves smoothly.
function envelope(values, reach) {
  const around = (all, k) => all.slice(Math.max(0, k - reach), k + reach + 1);
  const most = values.map((_, k) => Math.max(...around(values, k)));
  return most.map((_, k) => {
    const part = around(most, k);
    return part.reduce((sum, value) => sum + value, 0) / part.length;
  });
}

// The box that holds the working robots, frame by frame: [-left, -bottom, right, top].
// It reaches no farther than the walls.
function boxes({ columns, frames }) {
  const { num_trackers: n, control_step: step } = app.world.settings;
  const half = halfSides(app.world.settings);
  const edges = [[], [], [], []];
  for (let frame = 0; frame < frames; frame++) {
    const places = [[columns.get("target_x").at(frame), columns.get("target_y").at(frame)]];
    for (let i = 0; i < n; i++) {
      if (columns.get("tracker_broken").at(frame, i)) continue;
      places.push([columns.get("tracker_x").at(frame, i), columns.get("tracker_y").at(frame, i)]);
    }
    edges.forEach((edge, k) => {
      const reach = Math.max(...places.map((place) => (k < 2 ? -1 : 1) * place[k % 2]));
      edge.push(Math.min(reach + MARGIN, half[k % 2] + WALL));
    });
  }
  return edges.map((values) => envelope(values, Math.round(CALM / step)));
}

export class Camera {
  constructor(player, canvas) {
    this.player = player;
    this.canvas = canvas;
    this.edges = boxes(player);
    this.free = null; // {x, y, scale} once the user has moved it
    this.width = this.height = 1;
  }

  // The middle and the scale that show everything.
  own(position) {
    const room = [this.width - 12, this.height - TITLE - FOOT];
    const frame = Math.min(Math.floor(position), this.player.last);
    const next = Math.min(frame + 1, this.player.last);
    const share = Math.min(position - frame, 1);
    const [left, bottom, right, top] = this.edges.map((e) => e[frame] * (1 - share) + e[next] * share);
    const least = LEAST_SPAN / Math.min(...room);
    const needed = Math.max(least, (right + left) / room[0], (top + bottom) / room[1]);
    return { x: (right - left) / 2, y: (top - bottom) / 2, scale: 1 / needed };
  }

  // What to draw with: project and unproject between metres and pixels.
  look(position, others) {
    let { x, y, scale } = this.free ?? this.own(position);
    if (!this.free) scale = Math.min(...others.map((camera) => camera.own(position).scale));
    if (app.follow) {
      const n = app.world.settings.num_trackers;
      const robot = app.selected ?? n;
      const name = robot < n ? "tracker" : "target";
      [x, y] = ["x", "y"].map((part) => this.player.columns.get(`${name}_${part}`).between(position, robot % n));
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

// Zoom about a pixel and move by pixels, in all views.
export function moveCameras(cameras, factor, about, dx, dy) {
  const looks = cameras.map((camera) => camera.look(app.position, cameras));
  cameras.forEach((camera, k) => {
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
