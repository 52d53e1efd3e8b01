// The colours of figures and films.
import { readJson } from "./data.js";

export const colours = readJson("colours");

for (const [name, value] of Object.entries(colours)) {
  if (typeof value === "string") {
    document.documentElement.style.setProperty(`--${name.toLowerCase().replaceAll("_", "-")}`, value);
  }
}

export function faded(colour, share) {
  return colour + Math.round(255 * Math.max(0, Math.min(1, share))).toString(16).padStart(2, "0");
}
