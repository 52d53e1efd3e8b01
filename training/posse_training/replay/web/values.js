// Numbers as text, and elements: what the panel, the header and the legend are made of.
// Everything is set as text, never as markup: names and cards come from anywhere.

export function element(tag, content = "", className = "") {
  const made = document.createElement(tag);
  if (className) made.className = className;
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
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
  const text = value.toFixed(digits);
  return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", "−");
}

export function setting(value) {
  if (Array.isArray(value)) return `(${value.map(setting).join(", ")})`;
  if (typeof value === "number") {
    return Number.isFinite(value) ? String(value).replace("-", "−") : number(value);
  }
  if (value !== null && typeof value === "object") {
    return Object.entries(value).map(([name, one]) => `${name} ${setting(one)}`).join(", ");
  }
  return String(value ?? "none");
}

export function words(name) {
  return name.replaceAll("_", " ");
}

export function unit(text) {
  return text === "1" || text === "count" ? "" : text;
}
