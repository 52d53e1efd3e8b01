// Above the pictures: what was played.
import { app } from "./state.js";
import { element, setting, words } from "./values.js";

export function headline() {
  const { world } = app;
  const { num_trackers: team } = world.settings;
  const place = `${world.split} seed ${world.seed} world ${world.world}`;
  return `${world.scenario} v${world.version} · ${team} trackers · ${place}`;
}

function fact(name, value, title = "") {
  const made = element("span", [element("i", `${name} `), element("b", value)]);
  if (title) made.title = title;
  return made;
}

export function fillHeader() {
  const { world } = app;
  document.getElementById("scenario").replaceChildren(
    world.scenario, element("small", ` v${world.version}`),
  );
  const facts = [
    fact("world", String(world.world)),
    fact("seed", String(world.seed)),
    fact("split", world.split),
    ...(world.episode ? [fact("episode", String(world.episode))] : []),
    ...Object.entries(world.changed).map(([name, [there, here]]) => {
      const made = fact(words(name), `${setting(there)} → ${setting(here)}`, "changed setting");
      made.classList.add("changed");
      return made;
    }),
    fact("posse", `${world.posse}${world.commit ? ` (${world.commit})` : ""}`, "version, commit"),
  ];
  document.getElementById("facts").replaceChildren(...facts);
}
