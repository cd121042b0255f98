"use strict";
(() => {
  const $ = (id) => document.getElementById(id);
  const pictures = JSON.parse($("pictures").textContent);
  const [left, right, stage] = [$("left"), $("right"), $("stage")];
  const view = { wipe: 0.5, zoom: 1, x: 0, y: 0, error: false, flip: false };
  const clamp = (v, a, b) => Math.min(b, Math.max(a, v));

  // --- which pictures ---
  for (const select of [left, right]) {
    pictures.forEach((p, i) => select.add(new Option(p.name, i)));
  }
  left.value = 0;
  right.value = Math.min(1, pictures.length - 1);

  const source = (i) => {
    const error = $(`error-${i}`);
    return (view.error && error ? error : $(`picture-${i}`)).src;
  };
  const label = (i) => pictures[i].name + (view.error && $(`error-${i}`) ? ", error" : "");

  function choose() {
    const [a, b] = [left.value, right.value];
    $("image-left").src = source(a);
    $("image-right").src = source(b);
    $("image-left").alt = $("tag-left").textContent = label(a);
    $("image-right").alt = $("tag-right").textContent = label(b);
    $("error").setAttribute("aria-pressed", view.error);
    draw();
  }

  // --- how they are seen: both under one transform, in shares of the stage ---
  function draw() {
    const { zoom } = view;
    view.x = clamp(view.x, 1 - zoom, 0);
    view.y = clamp(view.y, 1 - zoom, 0);
    const wipe = view.flip ? 0 : view.wipe;
    for (const id of ["image-left", "image-right"]) {
      $(id).style.transform = `translate(${100 * view.x}%, ${100 * view.y}%) scale(${zoom})`;
    }
    $("pane-left").style.clipPath = `inset(0 ${100 * (1 - wipe)}% 0 0)`;
    $("handle").style.left = `${100 * wipe}%`;
    stage.setAttribute("aria-valuenow", Math.round(100 * wipe));
    stage.classList.toggle("zoomed", zoom > 1);
    $("tag-left").hidden = wipe < 0.12;
    $("tag-right").hidden = wipe > 0.88;
  }

  function zoomTo(zoom, at = { x: 0.5, y: 0.5 }) {
    zoom = clamp(zoom, 1, 32);
    // The point under the pointer stays where it is.
    view.x = at.x - ((at.x - view.x) * zoom) / view.zoom;
    view.y = at.y - ((at.y - view.y) * zoom) / view.zoom;
    view.zoom = zoom;
    draw();
  }

  const place = (e) => {
    const r = stage.getBoundingClientRect();
    return { x: (e.clientX - r.left) / r.width, y: (e.clientY - r.top) / r.height };
  };

  // --- mouse and touch ---
  const pointers = new Map();
  let drag = null;
  stage.addEventListener("pointerdown", (e) => {
    const at = place(e);
    pointers.set(e.pointerId, at);
    stage.setPointerCapture(e.pointerId);
    const near = Math.abs(at.x - view.wipe) * stage.clientWidth < 28;
    drag = view.zoom === 1 || near ? "wipe" : "pan";
    if (drag === "wipe") { view.wipe = clamp(at.x, 0, 1); draw(); }
  });
  stage.addEventListener("pointermove", (e) => {
    const before = pointers.get(e.pointerId);
    if (!before) return;
    const at = place(e);
    if (pointers.size === 2) {
      // Two fingers: zoom by their distance, about their middle.
      const other = [...pointers].find(([id]) => id !== e.pointerId)[1];
      const distance = (p) => Math.hypot((p.x - other.x) * stage.clientWidth, (p.y - other.y) * stage.clientHeight);
      const middle = { x: (at.x + other.x) / 2, y: (at.y + other.y) / 2 };
      view.x += (at.x - before.x) / 2;
      view.y += (at.y - before.y) / 2;
      zoomTo((view.zoom * distance(at)) / Math.max(distance(before), 1), middle);
    } else if (drag === "wipe") {
      view.wipe = clamp(at.x, 0, 1);
      draw();
    } else {
      view.x += at.x - before.x;
      view.y += at.y - before.y;
      draw();
    }
    pointers.set(e.pointerId, at);
  });
  for (const end of ["pointerup", "pointercancel"]) {
    stage.addEventListener(end, (e) => { pointers.delete(e.pointerId); });
  }
  stage.addEventListener("wheel", (e) => {
    e.preventDefault();
    zoomTo(view.zoom * Math.exp(-0.002 * e.deltaY), place(e));
  }, { passive: false });
  stage.addEventListener("dblclick", (e) => zoomTo(view.zoom > 1 ? 1 : 4, place(e)));

  // --- buttons and keys ---
  const step = (select, by) => {
    select.value = (Number(select.value) + by + pictures.length) % pictures.length;
    choose();
  };
  const toggle = () => { view.error = !view.error; choose(); };
  const swap = () => { [left.value, right.value] = [right.value, left.value]; choose(); };
  const reset = () => { Object.assign(view, { zoom: 1, x: 0, y: 0 }); draw(); };
  const theme = () => {
    const dark = document.documentElement.dataset.theme
      ? document.documentElement.dataset.theme === "dark"
      : matchMedia("(prefers-color-scheme: dark)").matches;
    document.documentElement.dataset.theme = dark ? "light" : "dark";
  };
  left.addEventListener("change", choose);
  right.addEventListener("change", choose);
  $("error").addEventListener("click", toggle);
  $("swap").addEventListener("click", swap);
  $("in").addEventListener("click", () => zoomTo(2 * view.zoom));
  $("out").addEventListener("click", () => zoomTo(view.zoom / 2));
  $("theme").addEventListener("click", theme);
  document.querySelectorAll("img[data-show]").forEach((img) => {
    img.addEventListener("click", () => {
      right.value = img.dataset.show;
      view.error = img.dataset.error === "1";
      choose();
      stage.scrollIntoView({ block: "center" });
      stage.focus({ preventScroll: true });
    });
  });

  const move = (dx, dy) => { view.x -= dx; view.y -= dy; draw(); };
  const keys = {
    e: toggle, x: swap, d: theme, n: () => step(right, 1), p: () => step(right, -1), N: () => step(left, 1), P: () => step(left, -1),
    "+": () => zoomTo(1.5 * view.zoom), "=": () => zoomTo(1.5 * view.zoom), "-": () => zoomTo(view.zoom / 1.5), 0: reset,
  };
  // Arrows belong to the page, except on the stage.
  const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
  document.addEventListener("keydown", (e) => {
    if (e.ctrlKey || e.metaKey || e.altKey || e.target.matches("select, input, textarea")) return;
    const arrow = arrows[e.key];
    if (arrow && document.activeElement === stage) {
      e.preventDefault();
      if (e.shiftKey || arrow[1]) move(0.1 * arrow[0], 0.1 * arrow[1]);
      else { view.wipe = clamp(view.wipe + 0.02 * arrow[0], 0, 1); draw(); }
    } else if (e.key === " " && document.activeElement === stage) {
      e.preventDefault();
      view.flip = true;
      draw();
    } else if (e.key in keys) {
      keys[e.key]();
    }
  });
  document.addEventListener("keyup", (e) => {
    if (e.key === " ") { view.flip = false; draw(); }
  });

  // --- tables sorted by a click ---
  document.querySelectorAll("table.sortable").forEach((table) => {
    const body = table.tBodies[0];
    table.querySelectorAll("thead th").forEach((th, column) => {
      th.querySelector("button").addEventListener("click", () => {
        const down = th.getAttribute("aria-sort") === "ascending";
        table.querySelectorAll("th[aria-sort]").forEach((other) => other.removeAttribute("aria-sort"));
        th.setAttribute("aria-sort", down ? "descending" : "ascending");
        const value = (row) => row.cells[column].dataset.v ?? row.cells[column].textContent;
        const missing = (v) => v === "" || v === "NaN";
        const rows = [...body.rows].sort((r, s) => {
          const [a, b] = [value(r), value(s)];
          if (missing(a) || missing(b)) return missing(a) - missing(b);
          const order = isNaN(a) || isNaN(b) ? a.localeCompare(b) : a - b;
          return down ? -order : order;
        });
        body.append(...rows);
      });
    });
  });
  choose();
})();
