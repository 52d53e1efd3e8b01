// Opens and closes the replays. Each is a page of its own in a frame: the parts that all have in
// common are stored once, deflated.
(async () => {
  const buttons = document.querySelectorAll("button[data-replay]");
  const say = (button, text) => {
    button.disabled = true;
    button.textContent = text;
  };

  const inflate = async (letters) => {
    const bytes = Uint8Array.from(atob(letters), (character) => character.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    return JSON.parse(await new Response(stream).text());
  };

  const pageOf = (shell, contents) =>
    shell.map((part, k) => part + (contents[k] ?? "")).join("");

  if (!globalThis.DecompressionStream) {
    for (const button of buttons) say(button, "Replays need a browser of 2023 or later.");
  } else if (buttons.length) {
    const shell = await inflate(document.getElementById("shell").textContent);
    const replays = JSON.parse(document.getElementById("replays").textContent);
    for (const button of buttons) {
      button.addEventListener("click", () => {
        const holder = button.closest("article");
        const open = holder.querySelector("iframe");
        if (open) {
          open.remove();
          button.textContent = "Play";
          return;
        }
        const frame = document.createElement("iframe");
        frame.title = holder.querySelector("h3").textContent;
        frame.setAttribute("sandbox", "allow-scripts allow-downloads");
        frame.allowFullscreen = true;
        frame.srcdoc = pageOf(shell, replays[Number(button.dataset.replay)]);
        holder.append(frame);
        button.textContent = "Close";
      });
    }
  }
  document.documentElement.dataset.ready = "yes";
})();
