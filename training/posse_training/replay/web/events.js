// The ticks of the timeline: a shape for each kind, so that colour is never all that tells.
import { colours } from "./colours.js";
import { cross, leaderMark } from "./robots.js";
import { disc, pen } from "./world.js";

export const EVENT_KINDS = {
  detection: "target detected",
  dart: "the target darts",
  contact: "contact",
  break: "a tracker breaks",
  leader: "the leader changes",
  settled: "settled",
};

const draw = {
  detection(ctx, x, y) {
    pen(ctx, colours.INK, 1.6);
    disc(ctx, x, y, 4);
    ctx.stroke();
    ctx.fillStyle = colours.INK;
    disc(ctx, x, y, 1.6);
    ctx.fill();
  },
  dart(ctx, x, y) {
    ctx.fillStyle = colours.TARGET;
    ctx.beginPath();
    ctx.moveTo(x + 5, y);
    ctx.lineTo(x - 4, y - 4);
    ctx.lineTo(x - 4, y + 4);
    ctx.fill();
  },
  contact(ctx, x, y) {
    ctx.fillStyle = colours.CONTACT;
    ctx.beginPath();
    for (let k = 0; k < 16; k++) {
      const radius = k % 2 ? 2.6 : 6;
      const angle = (Math.PI * k) / 8;
      ctx.lineTo(x + radius * Math.cos(angle), y + radius * Math.sin(angle));
    }
    ctx.fill();
  },
  break(ctx, x, y) {
    pen(ctx, colours.INK, 2);
    cross(ctx, x, y, 3.8);
  },
  leader: (ctx, x, y) => leaderMark(ctx, x, y + 4, 4.5),
  settled(ctx, x, y) {
    pen(ctx, colours.TASKS[2], 2.2);
    ctx.beginPath();
    ctx.moveTo(x - 4.5, y);
    ctx.lineTo(x - 1, y + 3.8);
    ctx.lineTo(x + 5, y - 4);
    ctx.stroke();
  },
};

export function eventGlyph(ctx, kind, x, y) {
  draw[kind]?.(ctx, x, y);
}
