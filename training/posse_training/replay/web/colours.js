// The colours of figures and films, light and dark.
import { readJson } from "./data.js";

const themes = readJson("colours");
export const colours = {};

export function useTheme(dark) {
  Object.assign(colours, themes[dark ? "dark" : "light"]);
  const root = document.documentElement;
  root.classList.toggle("dark", dark);
  for (const [name, value] of Object.entries(colours)) {
    if (typeof value === "string") {
      root.style.setProperty(`--${name.toLowerCase().replaceAll("_", "-")}`, value);
    }
  }
  colours.PLAYERS.forEach((value, k) => root.style.setProperty(`--player-${k}`, value));
}

export function faded(colour, share) {
  return colour + Math.round(255 * Math.max(0, Math.min(1, share))).toString(16).padStart(2, "0");
}
