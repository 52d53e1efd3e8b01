// Numbers as text, and elements; the header.
// Everything is set as text, never as markup: names and cards come from anywhere.
import { app } from "./state.js";

export function element(tag, content = "", className = "") {
  const made = document.createElement(tag);
  made.className = className;
  if (Array.isArray(content)) made.append(...content);
  else made.textContent = content;
  return made;
}

export function button(text, onClick, className = "") {
  const made = element("button", text, className);
  made.addEventListener("click", onClick);
  return made;
}

// A number with a true minus; none for what rounds to 0.
export function number(value, digits = 2) {
  if (Number.isNaN(value ?? NaN)) return "–";
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
  const text = value.toFixed(digits);
  return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", "−");
}

export function setting(value) {
  if (Array.isArray(value)) return `(${value.map(setting).join(", ")})`;
  if (Number.isFinite(value)) return String(value).replace("-", "−");
  if (typeof value === "number") return number(value);
  if (value !== null && typeof value === "object") {
    return Object.entries(value).map(([name, one]) => `${name} ${setting(one)}`).join(", ");
  }
  return String(value ?? "none");
}

export function words(name) {
  return name.replaceAll("_", " ");
}

export function fillHeader() {
  const { settings, world, seed, split, episode, changed, posse, commit } = app.world;
  const fact = (name, value, title = "", className = "") => {
    const made = element("span", [element("i", `${name} `), element("b", String(value))], className);
    made.title = title;
    return made;
  };
  const facts = [fact("world", world), fact("seed", seed), fact("split", split)];
  if (episode) facts.push(fact("episode", episode));
  for (const [name, [there, here]] of Object.entries(changed)) {
    facts.push(fact(words(name), `${setting(there)} → ${setting(here)}`, "changed setting", "changed"));
  }
  facts.push(fact("posse", commit ? `${posse} (${commit})` : posse, "version, commit"));
  document.getElementById("scenario").replaceChildren(settings.name, element("small", ` v${settings.version}`));
  document.getElementById("facts").replaceChildren(...facts);
}
