// Unpacks the page's code and runs it.
(async () => {
  const say = (text) => {
    const message = document.getElementById("message");
    message.textContent = text;
    message.hidden = false;
  };
  if (!globalThis.DecompressionStream) {
    say("This replay needs a browser of 2023 or later.");
    return;
  }
  const packed = atob(document.getElementById("code").textContent);
  const bytes = Uint8Array.from(packed, (character) => character.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  const script = document.createElement("script");
  script.type = "module";
  script.textContent = await new Response(stream).text();
  document.head.append(script);
})();
