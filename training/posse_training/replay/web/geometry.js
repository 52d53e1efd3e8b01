// What a tracker's sensor covers, with the shadows of obstacles.

const STEP = Math.PI / 90;
const GRAZE = 1e-5; // rad, to either side of an obstacle's rim

export function wrap(angle) {
  return angle - 2 * Math.PI * Math.round(angle / (2 * Math.PI));
}

// How far a ray from (x, y) goes before it meets a disc's rim; Infinity: it passes.
function untilDisc(x, y, cosine, sine, [ox, oy, radius]) {
  const dx = ox - x;
  const dy = oy - y;
  const along = dx * cosine + dy * sine;
  const across = dx * sine - dy * cosine;
  if (along <= 0 || Math.abs(across) >= radius) return Infinity;
  return Math.max(0, along - Math.sqrt(radius * radius - across * across));
}

function untilWall(x, y, cosine, sine, half) {
  const distance = (at, direction) =>
    direction > 0 ? (half - at) / direction : direction < 0 ? (-half - at) / direction : Infinity;
  return Math.min(distance(x, cosine), distance(y, sine));
}

// The corners of the area in sight, [x, y] each. What limits it: range, field of view (full angle,
// about the heading), obstacles [x, y, radius], walls at ±half. All may be without limit but one.
export function areaInSight(x, y, heading, range, view, obstacles, half) {
  const allRound = view >= 2 * Math.PI - 1e-9;
  const from = allRound ? -Math.PI : -view / 2;
  const to = allRound ? Math.PI : view / 2;
  const angles = [from, to];
  for (let angle = Math.ceil(from / STEP) * STEP; angle < to; angle += STEP) angles.push(angle);
  for (const [ox, oy, radius] of obstacles) {
    const distance = Math.hypot(ox - x, oy - y);
    if (distance <= radius || distance - radius > range) continue;
    const middle = Math.atan2(oy - y, ox - x) - heading;
    const spread = Math.asin(radius / distance);
    for (const turn of [-spread - GRAZE, -spread + GRAZE, 0, spread - GRAZE, spread + GRAZE]) {
      const angle = wrap(middle + turn);
      if (angle > from && angle < to) angles.push(angle);
    }
  }
  if (Number.isFinite(half)) {
    for (const [cx, cy] of [[half, half], [-half, half], [-half, -half], [half, -half]]) {
      const angle = wrap(Math.atan2(cy - y, cx - x) - heading);
      if (angle > from && angle < to) angles.push(angle);
    }
  }
  angles.sort((a, b) => a - b);
  const corners = allRound ? [] : [[x, y]];
  for (const angle of angles) {
    const cosine = Math.cos(heading + angle);
    const sine = Math.sin(heading + angle);
    let reach = Math.min(range, untilWall(x, y, cosine, sine, half));
    for (const disc of obstacles) reach = Math.min(reach, untilDisc(x, y, cosine, sine, disc));
    corners.push([x + reach * cosine, y + reach * sine]);
  }
  return corners;
}

export function inside(corners, x, y) {
  let within = false;
  for (let i = 0, j = corners.length - 1; i < corners.length; j = i++) {
    const [ax, ay] = corners[i];
    const [bx, by] = corners[j];
    if (ay > y !== by > y && x < ((bx - ax) * (y - ay)) / (by - ay) + ax) within = !within;
  }
  return within;
}

// The slots' places: they stand on the target in a frame that heads for `frame`.
export function slotPlaces(slots, x, y, frame) {
  const cosine = Math.cos(frame);
  const sine = Math.sin(frame);
  return slots.map(([sx, sy]) => [x + sx * cosine - sy * sine, y + sx * sine + sy * cosine]);
}
