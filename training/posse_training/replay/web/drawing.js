// Colours, strokes and marks that pictures, timeline and legend share.

// Those of figures and films, and what differs in the dark.
export const colours = JSON.parse(document.getElementById("colours").textContent);
if (matchMedia("(prefers-color-scheme: dark)").matches) Object.assign(colours, colours.DARK);
for (const [name, value] of Object.entries(colours)) {
  if (typeof value === "string") {
    document.documentElement.style.setProperty(`--${name.toLowerCase().replaceAll("_", "-")}`, value);
  }
}

export function faded(colour, share) {
  return colour + Math.round(255 * Math.max(0, Math.min(1, share))).toString(16).padStart(2, "0");
}

// How the next strokes look.
export function pen(ctx, colour, width, dashes = []) {
  ctx.strokeStyle = colour;
  ctx.lineWidth = width;
  ctx.setLineDash(dashes);
}

export function disc(ctx, x, y, radius) {
  ctx.beginPath();
  ctx.arc(x, y, radius, 0, 2 * Math.PI);
}

export function line(ctx, ax, ay, bx, by) {
  ctx.beginPath();
  ctx.moveTo(ax, ay);
  ctx.lineTo(bx, by);
  ctx.stroke();
}

export function setFont(ctx, size, weight = 400) {
  ctx.font = `${weight} ${size}px system-ui, -apple-system, "Segoe UI", Roboto, sans-serif`;
}

export function write(ctx, text, x, y, size, colour, align = "center", weight = 400) {
  setFont(ctx, size, weight);
  ctx.textAlign = align;
  ctx.textBaseline = "middle";
  ctx.fillStyle = colour;
  ctx.fillText(text, x, y);
}

// Text that stays readable on what lies below it.
export function label(ctx, text, x, y, colour) {
  write(ctx, text, x, y, 11, colour, "center", 500);
  pen(ctx, faded(colours.PAPER, 0.85), 3.5);
  ctx.lineJoin = "round";
  ctx.strokeText(text, x, y);
  ctx.fillText(text, x, y);
}

// A robot, or what is like one: a disc, and a line ahead.
export function robot(ctx, x, y, heading, radius, fill) {
  line(ctx, x, y, x + Math.cos(heading) * (radius + 5), y - Math.sin(heading) * (radius + 5));
  disc(ctx, x, y, radius);
  if (fill) {
    ctx.fillStyle = fill;
    ctx.fill();
  }
  ctx.stroke();
}

export function tracker(ctx, x, y, heading, radius, fill, rim = colours.TRACKER_RIM) {
  pen(ctx, rim, 1.6);
  robot(ctx, x, y, heading, radius, fill);
}

// Where a tracker believes to be.
export function ghost(ctx, x, y, heading, radius) {
  pen(ctx, faded(colours.INK, 0.45), 1.2);
  robot(ctx, x, y, heading, radius, faded(colours.TRACKER, 0.2));
}

export function target(ctx, x, y, heading, radius) {
  for (const [colour, grow, width] of [[colours.PAPER, 1, 4], [colours.TARGET, -0.4, 2.8]]) {
    pen(ctx, colour, width);
    robot(ctx, x, y, heading, radius + grow, colour);
  }
}

export function broken(ctx, x, y, arm) {
  pen(ctx, colours.INK, 2);
  line(ctx, x - arm, y - arm, x + arm, y + arm);
  line(ctx, x - arm, y + arm, x + arm, y - arm);
}

// A mark at its place: lines in a colour, or an area that is filled.
function mark(ctx, path, x, y, colour, width = 0) {
  ctx.save();
  ctx.translate(x, y);
  pen(ctx, colour, width);
  ctx.fillStyle = colour;
  if (width) ctx.stroke(new Path2D(path));
  else ctx.fill(new Path2D(path));
  ctx.restore();
}

export function leader(ctx, x, y) {
  mark(ctx, "M0 1.5L-6.5-8.5H6.5Z", x, y, colours.PAPER);
  mark(ctx, "M0 0L-5-7.5H5Z", x, y, colours.INK);
}

const DOT = "M-2 0A2 2 0 0 0 2 0A2 2 0 0 0-2 0";
const RAYS = Array.from({ length: 16 }, (_, k) => {
  const [radius, angle] = [k % 2 ? 2.6 : 6, (Math.PI * k) / 8];
  return `${radius * Math.cos(angle)} ${radius * Math.sin(angle)}`;
});

// The ticks of the timeline: a shape for each kind, so that colour is never all that tells.
export const EVENTS = {
  detection: {
    text: "target detected",
    draw: (ctx, x, y) => {
      mark(ctx, DOT, x, y, colours.INK);
      mark(ctx, "M-4 0A4 4 0 0 0 4 0A4 4 0 0 0-4 0", x, y, colours.INK, 1.6);
    },
  },
  dart: {
    text: "the target darts",
    draw: (ctx, x, y) => mark(ctx, "M5 0L-4-4V4Z", x, y, colours.TARGET),
  },
  contact: {
    text: "contact",
    draw: (ctx, x, y) => mark(ctx, `M${RAYS.join("L")}Z`, x, y, colours.CONTACT),
  },
  break: { text: "a tracker breaks", draw: (ctx, x, y) => broken(ctx, x, y, 3.8) },
  leader: { text: "the leader changes", draw: (ctx, x, y) => leader(ctx, x, y + 4) },
  settled: {
    text: "settled",
    draw: (ctx, x, y) => mark(ctx, "M-4.5 0L-1 3.8L5-4", x, y, colours.TASKS[2], 2.2),
  },
};
