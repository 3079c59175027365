// What leaves the page: texts to the clipboard, pictures as SVG.
"use strict";

const Saving = (() => {
  const { svg, html } = Page;

  /** Copy a text; what happened, in words. */
  async function copy(words, name) {
    try {
      await navigator.clipboard.writeText(words);
      return `${name} copied.`;
    } catch {
      const area = html("textarea"); // a page from a file may have no clipboard
      area.value = words;
      document.body.append(area);
      area.select();
      const isCopied = document.execCommand("copy");
      area.remove();
      return isCopied ? `${name} copied.` : "The browser refuses to copy.";
    }
  }

  /** The style sheets of the page as they are for an SVG file, with colours in place of variables. */
  function styles() {
    const own = getComputedStyle(document.documentElement);
    const sheet = [...document.querySelectorAll("style")].map((e) => e.textContent).join("\n");
    const rules = sheet.match(/(^|\n)\s*(svg|\.mode-)[^{}]*\{[^{}]*\}/g).join("\n");
    return rules.replace(/var\((--[\w-]+)\)/g, (_, name) => own.getPropertyValue(name).trim());
  }

  /** Pictures below one another as the text of an SVG file. */
  function picture(shown) {
    const gap = 8;
    const width = Math.max(...shown.map((plane) => plane.width));
    const height = shown[0].height + gap + shown[1].height;
    const copies = shown.map((plane, k) => {
      const element = plane.element.cloneNode(true);
      element.querySelectorAll(".grip").forEach((e) => e.remove());
      const size = { width: plane.width, height: plane.height, y: k ? shown[0].height + gap : 0 };
      for (const [name, value] of Object.entries(size)) element.setAttribute(name, value);
      element.removeAttribute("class");
      return element;
    });
    const ground = getComputedStyle(document.documentElement).getPropertyValue("--ground").trim();
    const frame = {
      xmlns: "http://www.w3.org/2000/svg",
      viewBox: `0 0 ${width} ${height}`,
      width,
      height,
    };
    const style = svg("style", {}, `${styles()}\nsvg { font: 13px sans-serif; }`);
    const whole = svg("svg", frame, style, svg("rect", { width, height, fill: ground }), ...copies);
    return new XMLSerializer().serializeToString(whole);
  }

  return { copy, picture };
})();
