"use strict";
(() => {
  const { totals, rows } = BATCH;
  const at = (id) => document.getElementById(id);
  // All text goes in as text: nothing of a file name is ever read as markup.
  const make = (tag, text, name) => {
    const e = document.createElement(tag);
    if (text !== undefined && text !== null) e.textContent = text;
    if (name) e.className = name;
    return e;
  };
  const has = (x) => typeof x === "number" && Number.isFinite(x);
  const number = (x) => (has(x) ? (x === 0 ? "0" : Number(x.toPrecision(4)).toString()) : "");
  const count = (x) => (has(x) ? x.toLocaleString("en").replaceAll(",", "\u202f") : "");
  const bytes = (x) => {
    if (!has(x)) return "";
    const units = ["B", "KiB", "MiB", "GiB", "TiB"];
    let i = 0;
    while (x >= 1024 && i + 1 < units.length) { x /= 1024; i += 1; }
    return `${i ? x.toFixed(1) : x} ${units[i]}`;
  };
  const family = (r) => (r.kind && r.kind.includes("volume") ? "volume" : r.kind && r.kind.includes("mesh") ? "mesh" : "cloud");
  // Only what the program itself names may be a link: parts of a path below this page.
  const link = (path) => path.split("/").map(encodeURIComponent).join("/");

  const sums = [
    `${count(totals.inputs)} inputs: ${count(totals.done)} done`,
    totals.failed ? `${count(totals.failed)} failed` : "none failed",
    totals.pending ? `${count(totals.pending)} not tried yet` : "",
    `${number(totals.input_seconds)} s of work`,
    totals.peak_rss_bytes ? `largest process ${bytes(totals.peak_rss_bytes)}` : "",
    `${bytes(totals.input_bytes)} read, ${bytes(totals.output_bytes)} written`,
  ];
  at("totals").textContent = sums.filter(Boolean).join(" · ");
  at("parameters").textContent = [totals.program, ...Object.entries(totals.parameters).map(([k, v]) => `${k} ${v}`), ...totals.notes].join(" · ");

  const failed = rows.filter((r) => r.state === "failed");
  if (failed.length) {
    at("failures").hidden = false;
    const list = document.createDocumentFragment();
    for (const r of failed) {
      list.append(make("dt", r.input), make("dd", `${r.stage ?? "?"}: ${r.reason ?? "unknown"}`, "bad"));
    }
    at("failed").append(list);
  }
  if (totals.skipped.length) {
    at("others").hidden = false;
    at("skipped").append(...totals.skipped.map((s) => make("li", s)));
  }

  const columns = [
    ["picture", "", "140px"],
    ["input", "Input", "22%"],
    ["state", "State", "5.5rem"],
    ["kind", "Kind", "8rem"],
    ["rms", "Error rms", "6.5rem", number],
    ["p95", "p95", "6.5rem", number],
    ["max", "max", "6.5rem", number],
    ["unit", "Unit", "4.5rem"],
    ["coefficients", "Coefficients", "7.5rem", count],
    ["seconds", "Seconds", "6rem", number],
    ["peak", "Peak memory", "7rem", bytes],
    ["bytes", "Field", "6.5rem", bytes],
    ["hash", "Field sha256", "9rem"],
    ["notes", "Notes", ""],
  ];
  const head = document.querySelector("#table thead tr");
  const sort = { key: "", down: false };
  for (const [key, title, width, format] of columns) {
    const th = make("th", undefined, format ? "number" : "");
    th.scope = "col";
    if (width) th.style.width = width;
    if (title && key !== "notes") {
      const button = make("button", title);
      button.type = "button";
      button.dataset.key = key;
      button.addEventListener("click", () => {
        sort.down = sort.key === key ? !sort.down : false;
        sort.key = key;
        for (const other of head.children) other.removeAttribute("aria-sort");
        th.setAttribute("aria-sort", sort.down ? "descending" : "ascending");
        order();
        show();
      });
      th.append(button);
    } else {
      th.textContent = title || "Picture";
    }
    head.append(th);
  }

  const picture = (path, what) => {
    const img = document.createElement("img");
    img.loading = "lazy";
    img.decoding = "async";
    img.width = 120;
    img.height = 90;
    img.alt = what;
    img.src = link(path);
    return img;
  };
  const cell = (r, key, format) => {
    if (format) return make("td", format(r[key]), "number");
    const td = document.createElement("td");
    if (key === "picture") {
      if (r.picture) td.append(picture(r.picture, `the solid of ${r.input}`));
      if (r.errors) td.append(picture(r.errors, `errors of ${r.input}`));
    } else if (key === "input") {
      td.append(make("div", r.input));
      const links = make("div", undefined, "quiet");
      for (const what of ["field", "mesh"]) {
        if (!r[what]) continue;
        const a = make("a", what);
        a.href = link(r[what]);
        links.append(a, " ");
      }
      td.append(links);
    } else if (key === "state") {
      td.append(make("span", r.state, r.state === "done" ? "good" : "bad"));
    } else if (key === "hash") {
      const span = make("span", r.hash ? r.hash.slice(0, 16) : "", "hash");
      if (r.hash) span.title = r.hash;
      td.append(span);
    } else if (key === "notes") {
      const list = make("ul", undefined, "notes");
      if (r.reason) list.append(make("li", r.reason, "bad"));
      for (const note of r.notes) list.append(make("li", note));
      if (list.children.length) td.append(list);
    } else {
      td.textContent = r[key] ?? "";
    }
    return td;
  };
  const all = rows.map((r, i) => {
    const words = [r.input, r.kind, r.unit, r.reason, r.hash, ...r.notes].filter(Boolean).join("\n").toLowerCase();
    return { r, tr: null, i, words };
  });
  // Rows are made when they are first seen.
  const rowOf = (x) => {
    if (!x.tr) {
      x.tr = document.createElement("tr");
      for (const [key, , , format] of columns) x.tr.append(cell(x.r, key, format));
    }
    return x.tr;
  };
  if (rows.some((r) => r.errors)) at("legend").hidden = false;

  const body = document.querySelector("#table tbody");
  const collator = new Intl.Collator("en", { numeric: true });
  let sorted = all;
  const order = () => {
    const { key, down } = sort;
    const sign = down ? -1 : 1;
    sorted = all.slice();
    if (!key) return;
    const isNumber = all.some((x) => has(x.r[key]));
    sorted.sort((a, b) => {
      const [x, y] = [a.r[key], b.r[key]];
      // What has no value is last, whichever way.
      const [none, nor] = [x === null || x === undefined, y === null || y === undefined];
      if (none || nor) return none - nor || a.i - b.i;
      return sign * (isNumber ? x - y : collator.compare(x, y)) || a.i - b.i;
    });
  };
  const passes = ({ r, words }) => {
    const state = at("state").value;
    if (state === "notes" ? !r.notes.length : state && r.state !== state) return false;
    return at("find").value.toLowerCase().split(/\s+/).every((w) => words.includes(w));
  };
  // As many rows as have been scrolled to: a browser takes seconds to lay out thousands with their pictures.
  const PART = 100;
  let [seen, drawn] = [[], 0];
  const draw = (most) => {
    body.append(...seen.slice(drawn, most).map(rowOf));
    drawn = Math.min(most, seen.length);
    at("more").hidden = drawn === seen.length;
  };
  const show = () => {
    seen = sorted.filter(passes);
    body.replaceChildren();
    drawn = 0;
    draw(PART);
    at("shown").textContent = `${count(seen.length)} of ${count(all.length)}`;
  };
  at("more").addEventListener("click", () => draw(drawn + PART));
  new IntersectionObserver((all) => {
    if (all.some((x) => x.isIntersecting)) draw(drawn + PART);
  }, { rootMargin: "600px" }).observe(at("more"));
  at("find").addEventListener("input", show);
  at("state").addEventListener("change", show);
  show();

  // Errors are lengths or densities; only those of one unit are drawn together.
  const points = rows.filter((r) => has(r.rms) && has(r.seconds) && r.seconds > 0);
  const groups = new Map();
  for (const r of points) {
    const name = `${family(r) === "volume" ? "volumes" : "clouds and meshes"}, ${r.unit || "no unit"}`;
    groups.set(name, [...(groups.get(name) ?? []), r]);
  }
  const largest = [...groups].sort((a, b) => b[1].length - a[1].length);
  at("unit").append(...largest.map(([name, list]) => {
    const option = make("option", `${name} (${list.length})`);
    option.value = name;
    return option;
  }));
  if (!points.length) at("chart").hidden = true;

  const SVG = `${"http"}://www.w3.org/2000/svg`;
  const svg = (tag, attributes, text) => {
    // A name, no address: nothing is fetched from there.
    const e = document.createElementNS(SVG, tag);
    for (const [k, v] of Object.entries(attributes)) e.setAttribute(k, v);
    if (text !== undefined) e.textContent = text;
    return e;
  };
  const scatter = () => {
    const key = at("measure").value;
    const list = (groups.get(at("unit").value) ?? []).filter((r) => has(r[key]));
    const [width, height, left, bottom, rim] = [900, 420, 80, 46, 14];
    const root = svg("svg", { viewBox: `0 0 ${width} ${height}`, role: "img" });
    root.append(svg("title", {}, `error ${key} against seconds`));
    // Logarithms; an exact fit lies at the lower edge.
    const positive = list.map((r) => r[key]).filter((x) => x > 0);
    const range = (values) => {
      const logs = values.map(Math.log10);
      let [low, high] = logs.length ? [logs.reduce((a, b) => Math.min(a, b)), logs.reduce((a, b) => Math.max(a, b))] : [-1, 0];
      if (high - low < 0.5) { low -= 0.25; high += 0.25; }
      return [low - 0.05 * (high - low), high + 0.05 * (high - low)];
    };
    const [x0, x1] = range(list.map((r) => r.seconds));
    const [y0, y1] = range(positive);
    const x = (s) => left + ((Math.log10(s) - x0) / (x1 - x0)) * (width - left - rim);
    const y = (e) => height - bottom - (e > 0 ? (Math.log10(e) - y0) / (y1 - y0) : 0) * (height - bottom - rim);
    const ticks = (low, high) => {
      const steps = high - low > 3 ? [1] : [1, 2, 5];
      const found = [];
      for (let d = Math.floor(low); d <= high; d += 1) for (const s of steps) {
        const v = s * 10 ** d;
        if (Math.log10(v) >= low && Math.log10(v) <= high) found.push(v);
      }
      return found;
    };
    for (const v of ticks(x0, x1)) {
      root.append(svg("line", { class: "axis", x1: x(v), x2: x(v), y1: rim, y2: height - bottom }));
      root.append(svg("text", { x: x(v), y: height - bottom + 16, "text-anchor": "middle" }, number(v)));
    }
    for (const v of ticks(y0, y1)) {
      root.append(svg("line", { class: "axis", x1: left, x2: width - rim, y1: y(v), y2: y(v) }));
      root.append(svg("text", { x: left - 6, y: y(v) + 4, "text-anchor": "end" }, number(v)));
    }
    root.append(svg("text", { x: (left + width) / 2, y: height - 8, "text-anchor": "middle" }, "seconds, all that was done for the input"));
    root.append(svg("text", { x: 14, y: height / 2, "text-anchor": "middle", transform: `rotate(-90 14 ${height / 2})` }, `error ${key}, ${list[0]?.unit ?? ""}`));
    for (const r of list) {
      const dot = svg("circle", { class: family(r), cx: x(r.seconds).toFixed(1), cy: y(r[key]).toFixed(1), r: 4.5 });
      dot.append(svg("title", {}, `${r.input}\n${number(r[key])} in ${number(r.seconds)} s`));
      dot.addEventListener("click", () => go(r));
      root.append(dot);
    }
    at("scatter").replaceChildren(root);
  };
  const go = (r) => {
    at("find").value = "";
    at("state").value = "";
    show();
    const place = seen.findIndex((x) => x.r === r);
    if (place >= drawn) draw(place + PART);
    for (const x of all) if (x.tr) x.tr.classList.toggle("marked", x.r === r);
    seen[place].tr.scrollIntoView({ block: "center" });
  };
  at("measure").addEventListener("change", scatter);
  at("unit").addEventListener("change", scatter);
  scatter();

  // Paper has no scrolling that would load them.
  addEventListener("beforeprint", () => {
    draw(seen.length);
    for (const img of document.images) img.loading = "eager";
  });
})();
