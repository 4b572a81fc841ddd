// Turns each recorded run on the page into a player: the arena on a canvas, the clearance below it, play, speed, time.
"use strict";
(() => {
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const sum = (steps, per) => { let at = 0; return steps.map((step) => (at += step) / per); };
  const make = (tag, attributes = {}, ...inside) => {
    const element = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    element.append(...inside);
    return element;
  };
  const LEGEND = [["--c1", "robot, its way", "○"], ["--c0", "held: collision imminent", "○"], ["--ink", "others", "○"], ["--c3", "goal", "○"]];
  const players = [];
  const TRAIL = 3; // how long an obstacle's trail is [s]
  const redraws = [];

  function player(figure) {
    const d = JSON.parse(figure.querySelector('script[type="application/json"]').textContent);
    const t = sum(d.t, 1000), x = sum(d.x, 1000), y = sum(d.y, 1000), h = sum(d.h, 1000);
    const ox = d.ox.map((steps) => sum(steps, 1000)), oy = d.oy.map((steps) => sum(steps, 1000));
    const n = t.length, start = t[0], end = t[n - 1];
    const halted = new Array(n).fill(false);
    d.halts.forEach((from, k) => { if (k % 2 === 0) halted.fill(true, from, d.halts[k + 1] ?? n); });
    const ground = d.gaps ? sum(d.gaps, 1000) : [], body = d.body ?? [];
    const gap = t.map((_, i) => Math.min(ground[i] ?? Infinity, ...ox.map((_, k) =>
      Math.hypot(ox[k][i] - x[i], oy[k][i] - y[i]) - d.r - d.or[k])));
    const [lowest, least] = d.least ?? [0, Infinity]; // sample and clearance, as they were before rounding
    const [width, height] = d.size, rim = 1.2 * Math.max(d.r, d.tol, 0, ...d.or);

    const field = make("canvas", { class: "field", "aria-hidden": "true" });
    const strip = make("canvas", { class: "strip", "aria-hidden": "true", title: "Clearance up to 0.5 m, speed, requirements over time; drag to move in time" });
    const required = d.req ?? [], HIGH = 44, tall = 96 + HIGH * required.length;
    const rate = t.map((_, i) => { const a = Math.max(0, i - 2), b = Math.min(n - 1, i + 2); return b > a ? Math.hypot(x[b] - x[a], y[b] - y[a]) / (t[b] - t[a]) : 0; });
    const fastest = Math.max(0.1, ...rate);
    const back = make("button", { type: "button", class: "step", "aria-label": "Step back" }, "‹");
    const on = make("button", { type: "button", class: "step", "aria-label": "Step on" }, "›");
    const full = make("button", { type: "button" }, "Full screen");
    const parts = [...LEGEND, ...(d.scan?.[0] ? [["--c5", "what the scan meets", "•"]] : []), ...(d.path?.length ? [["--c3", "way that is shown to the planner", "╌"]] : [])];
    const legend = make("p", { class: "legend" }, ...parts.map(([colour, words, sign]) => {
      const mark = make("span", { "aria-hidden": "true" }, sign);
      mark.style.color = `var(${colour})`;
      return make("span", {}, mark, ` ${words}`);
    }));
    const button = make("button", { type: "button" }, "Play");
    const slider = make("input", { type: "range", min: start, max: end, step: "any", value: start, "aria-label": "Time" });
    const speed = make("select", { "aria-label": "Speed" }, ...[1, 2, 5].map((k) => make("option", { value: k }, `${k}×`)));
    const output = make("output");
    const box = make("div", { class: "player" }, field, strip, make("div", { class: "bar" }, button, slider, speed), make("div", { class: "bar more" }, back, on, full), output, legend);
    figure.querySelector(".still").after(box);

    let now = start, running = false, last = 0;
    const tallest = () => (document.fullscreenElement === box ? Math.max(200, innerHeight - tall - 140) : 640);

    const sample = (time) => { // the last sample at or before a time
      let low = 0, high = n - 1;
      while (low < high) { const mid = (low + high + 1) >> 1; if (t[mid] <= time) low = mid; else high = mid - 1; }
      return low;
    };
    const turn = (from, to) => Math.atan2(Math.sin(to - from), Math.cos(to - from));

    function prepare(canvas, w, hgt) { // crisp on any screen; returns a context in CSS pixels
      const ratio = window.devicePixelRatio || 1;
      if (canvas.width !== Math.round(w * ratio) || canvas.height !== Math.round(hgt * ratio)) {
        canvas.width = Math.round(w * ratio); canvas.height = Math.round(hgt * ratio);
        canvas.style.height = `${hgt}px`;
      }
      const g = canvas.getContext("2d");
      g.setTransform(ratio, 0, 0, ratio, 0, 0);
      g.clearRect(0, 0, w, hgt);
      return g;
    }

    function seen(cx, cy, heading, round) { // where the beams of the scan end, without noise
      const [beams, first, step, reach] = d.scan, ends = [];
      for (let k = 0; k < beams; k++) {
        const dx = Math.cos(heading + first + k * step), dy = Math.sin(heading + first + k * step);
        let far = reach;
        for (const [a, b, c, e] of d.walls) {
          const ux = c - a, uy = e - b, cross = dx * uy - dy * ux;
          if (!cross) continue;
          const along = ((a - cx) * uy - (b - cy) * ux) / cross, on = ((a - cx) * dy - (b - cy) * dx) / cross;
          if (along >= 0 && along < far && on >= 0 && on <= 1) far = along;
        }
        for (const [a, b, r] of round) {
          const mid = (a - cx) * dx + (b - cy) * dy, aside = (a - cx) * dy - (b - cy) * dx;
          const along = mid - Math.sqrt(r * r - aside * aside); // NaN where the beam passes
          if (along >= 0 && along < far) far = along;
        }
        if (far < reach) ends.push([cx + far * dx, cy + far * dy]);
      }
      return ends;
    }

    function draw() {
      const w = box.clientWidth;
      if (!w) return;
      const scale = Math.min(w / (width + 2 * rim), tallest() / (height + 2 * rim));
      const left = (w - width * scale) / 2;
      const px = (m) => left + m * scale, py = (m) => (height + rim - m) * scale;
      const g = prepare(field, w, (height + 2 * rim) * scale);
      const ink = css("--ink"), muted = css("--muted"), rule = css("--rule");
      const i = sample(now), j = Math.min(i + 1, n - 1);
      const f = j > i ? (now - t[i]) / (t[j] - t[i]) : 0;
      const mix = (list) => list[i] + f * (list[j] - list[i]);
      const disc = (cx, cy, r) => { g.beginPath(); g.arc(px(cx), py(cy), r * scale, 0, 2 * Math.PI); };

      g.fillStyle = css("--panel"); g.fillRect(px(0), py(height), width * scale, height * scale);
      g.strokeStyle = rule; g.lineWidth = 1; g.beginPath();
      const step = 0.5 * Math.max(1, Math.ceil(Math.max(width, height) / 20));
      for (let a = step; a < width - 1e-9; a += step) { g.moveTo(px(a), py(0)); g.lineTo(px(a), py(height)); }
      for (let a = step; a < height - 1e-9; a += step) { g.moveTo(px(0), py(a)); g.lineTo(px(width), py(a)); }
      g.stroke();
      g.strokeStyle = muted; g.strokeRect(px(0), py(height), width * scale, height * scale);
      g.strokeStyle = g.fillStyle = ink; g.lineWidth = 2; g.beginPath();
      for (const [a, b, c, e] of d.walls ?? []) { g.moveTo(px(a), py(b)); g.lineTo(px(c), py(e)); }
      g.stroke();
      for (const [a, b, r] of d.discs ?? []) { disc(a, b, r); g.globalAlpha = 0.55; g.fill(); g.globalAlpha = 1; }

      for (const goal of [...(d.goals ?? []), d.goal]) {
      disc(...goal, d.tol);
      g.fillStyle = g.strokeStyle = css("--c3"); g.globalAlpha = 0.14; g.fill(); g.globalAlpha = 1; g.lineWidth = 1.5; g.stroke();
      }
      g.lineWidth = 1; g.setLineDash([6, 4]); g.beginPath();
      (d.path ?? []).forEach(([a, b], s) => g[s ? "lineTo" : "moveTo"](px(a), py(b)));
      g.stroke(); g.setLineDash([]);

      const from = sample(Math.max(start, now - TRAIL));
      ox.forEach((_, k) => {
        g.strokeStyle = ink; g.lineWidth = 2; g.lineCap = "round";
        for (let s = from; s < i; s++) {
          g.globalAlpha = 0.5 * (1 - (now - t[s]) / TRAIL);
          if (g.globalAlpha <= 0) continue;
          g.beginPath(); g.moveTo(px(ox[k][s]), py(oy[k][s])); g.lineTo(px(ox[k][s + 1]), py(oy[k][s + 1])); g.stroke();
        }
        disc(mix(ox[k]), mix(oy[k]), d.or[k]);
        g.fillStyle = ink; g.globalAlpha = 0.22; g.fill(); g.globalAlpha = 0.75; g.lineWidth = 1.2; g.stroke(); g.globalAlpha = 1;
      });

      g.globalAlpha = 0.35; g.lineWidth = 1; g.setLineDash([2, 4]); // the whole way, past and to come
      const whole = (a, b, stroke) => { g.strokeStyle = stroke; g.beginPath(); a.forEach((v, s) => g[s ? "lineTo" : "moveTo"](px(v), py(b[s]))); g.stroke(); };
      ox.forEach((_, k) => whole(ox[k], oy[k], ink));
      g.globalAlpha = 0.8; whole(x, y, css("--c1"));
      g.setLineDash([]); g.globalAlpha = 1;

      const colour = halted[i] ? css("--c0") : css("--c1");
      g.strokeStyle = css("--c1"); g.lineWidth = 1.6; g.lineJoin = "round"; g.globalAlpha = 0.8; g.beginPath(); g.moveTo(px(x[0]), py(y[0]));
      for (let s = 1; s <= i; s++) g.lineTo(px(x[s]), py(y[s]));
      g.lineTo(px(mix(x)), py(mix(y))); g.stroke();
      const heading = h[i] + f * turn(h[i], h[j]);
      if (d.scan?.[0]) {
        const round = [...(d.discs ?? []), ...ox.map((_, k) => [mix(ox[k]), mix(oy[k]), d.or[k]])];
        g.fillStyle = css("--c5");
        for (const [a, b] of seen(mix(x), mix(y), heading, round)) g.fillRect(px(a) - 1.5, py(b) - 1.5, 3, 3);
      }
      if (body.length) {
        g.beginPath();
        body.forEach(([a, b], k) => g[k ? "lineTo" : "moveTo"](
          px(mix(x) + a * Math.cos(heading) - b * Math.sin(heading)), py(mix(y) + a * Math.sin(heading) + b * Math.cos(heading))));
        g.closePath();
      } else disc(mix(x), mix(y), d.r);
      g.fillStyle = g.strokeStyle = colour; g.globalAlpha = 0.35; g.fill(); g.globalAlpha = 1; g.lineWidth = 2; g.stroke();
      g.beginPath(); g.moveTo(px(mix(x)), py(mix(y)));
      g.lineTo(px(mix(x) + d.r * Math.cos(heading)), py(mix(y) + d.r * Math.sin(heading))); g.stroke();

      drawStrip(w, px(0), px(width));
      const clear = gap.length && isFinite(gap[i]) ? `${(gap[i] + f * (gap[j] - gap[i])).toFixed(3)} m` : "–";
      const cell = (label, value, name = "") => {
        const b = make("b", name ? { class: name } : {}, value);
        return make("span", {}, `${label} `, b);
      };
      const broken = required.filter(([, when]) => when !== null && when <= now + 1e-3).map(([name]) => name);
      output.replaceChildren(cell("time", `${now.toFixed(1)} s`), cell("clearance", clear),
        cell("speed", `${(rate[i] + f * (rate[j] - rate[i])).toFixed(2)} m/s`), ...(broken.length ? [cell("violated", broken.join(", "), "alert")] : []),
        ...required.map(([name, , unit, margin]) => { const v = marginNow(margin); return cell(name, v === null ? "–" : `${v.toFixed(3)} ${unit}`, v < 0 ? "alert" : ""); }),
        cell("least", isFinite(least) ? `${least.toFixed(3)} m` : "–"), cell("", halted[i] ? "halted" : "free", halted[i] ? "alert" : ""));
      slider.value = now;
      slider.setAttribute("aria-valuetext", `${now.toFixed(1)} s, clearance ${clear}${halted[i] ? ", halted" : ""}`);
    }

    function drawStrip(w, from, to) { // one time line: clearance, shaded while halted; speed; how far requirements are from being violated
      drawLine(w, from, to, 54);
      const g = strip.getContext("2d"), across = (time) => from + (to - from) * (time - start) / (end - start || 1);
      const up = (v) => 90 - 30 * v / fastest;
      g.strokeStyle = css("--rule"); g.lineWidth = 1; g.beginPath(); g.moveTo(from, up(0)); g.lineTo(to, up(0)); g.stroke();
      g.strokeStyle = css("--c1"); g.lineWidth = 1.3; g.beginPath();
      rate.forEach((v, s) => g[s ? "lineTo" : "moveTo"](across(t[s]), up(v)));
      g.stroke();
      g.font = "11px system-ui, sans-serif"; g.textBaseline = "middle"; g.fillStyle = css("--muted"); g.textAlign = "left";
      g.fillText("clearance, up to 0.5 m", from + 2, 8); g.fillText(`speed, up to ${fastest.toFixed(2)} m/s`, from + 2, 58);
      required.forEach(([name, , , margin], k) => drawMargin(g, name, margin, across, from, to, 96 + HIGH * k));
      g.strokeStyle = css("--c1"); g.lineWidth = 1.5; g.beginPath(); g.moveTo(across(now), 2); g.lineTo(across(now), tall - 2); g.stroke();
    }

    function drawMargin(g, name, margin, across, from, to, top) { // robustness so far: above the line it is kept
      const known = margin.filter((v) => v !== null), high = Math.max(0, ...known), low = Math.min(0, ...known);
      const up = (v) => top + HIGH - 4 - (HIGH - 20) * (v - low) / (high - low || 1);
      g.strokeStyle = css("--rule"); g.lineWidth = 1; g.beginPath(); g.moveTo(from, up(0)); g.lineTo(to, up(0)); g.stroke();
      g.lineWidth = 2;
      for (let s = 1; s < margin.length; s++) {
        if (margin[s] === null || margin[s - 1] === null) continue;
        g.strokeStyle = css(margin[s] < 0 ? "--c0" : "--c3");
        g.beginPath(); g.moveTo(across(d.at[s - 1]), up(margin[s - 1])); g.lineTo(across(d.at[s]), up(margin[s])); g.stroke();
      }
      g.fillStyle = css("--muted"); g.fillText(name, from + 2, top + 7);
    }
    const marginNow = (margin) => { let s = 0; while (s + 1 < d.at.length && d.at[s + 1] <= now + 1e-3) s++; return margin[s]; };

    function drawLine(w, from, to, high) {
      const g = prepare(strip, w, tall), across = (time) => from + (to - from) * (time - start) / (end - start || 1);
      g.globalAlpha = 0.2; g.fillStyle = css("--c0");
      d.halts.forEach((a, k) => {
        if (k % 2 === 0) { const b = d.halts[k + 1] ?? n - 1; g.fillRect(across(t[a]), 6, Math.max(1, across(t[b]) - across(t[a])), high - 12); }
      });
      g.globalAlpha = 1;
      if (isFinite(least)) {
        const low = Math.min(0, least), top = Math.max(0.5, low + 0.5), up = (v) => high - 6 - (high - 12) * (Math.min(v, top) - low) / (top - low);
        g.strokeStyle = css("--rule"); g.lineWidth = 1; g.beginPath(); g.moveTo(from, up(0)); g.lineTo(to, up(0)); g.stroke();
        g.strokeStyle = css("--muted"); g.lineWidth = 1.3; g.beginPath();
        gap.forEach((v, s) => g[s ? "lineTo" : "moveTo"](across(t[s]), up(v)));
        g.stroke();
        g.fillStyle = css("--ink"); g.beginPath(); g.arc(across(t[lowest]), up(least), 2.6, 0, 2 * Math.PI); g.fill();
      }
    }

    const group = figure.closest(".replays[data-together]");
    const others = () => (group ? players.filter((one) => one.group === group && one !== self) : []);
    const self = { group, show(time) { now = Math.min(end, Math.max(start, time)); draw(); }, halt() { if (running) set(false); } };
    players.push(self);
    const shared = () => others().forEach((one) => one.show(now));

    function frame(stamp) {
      if (!running) return;
      now += Math.min(0.25, (stamp - last) / 1000) * Number(speed.value);
      last = stamp;
      if (now >= end) { now = end; set(false); }
      draw();
      shared();
      if (running) requestAnimationFrame(frame);
    }
    function set(go) {
      running = go;
      button.textContent = go ? "Pause" : now >= end ? "Replay" : "Play";
      if (!go) return;
      others().forEach((one) => one.halt());
      if (now >= end) now = start;
      requestAnimationFrame((stamp) => { last = stamp; frame(stamp); });
    }
    function seek(time) {
      now = Math.min(end, Math.max(start, time));
      if (!running) set(false);
      draw();
      shared();
    }
    function stepped(by) { // to the next sample
      set(false);
      const i = sample(now);
      seek(by < 0 && now > t[i] ? t[i] : t[Math.min(n - 1, Math.max(0, i + by))]);
    }

    button.addEventListener("click", () => set(!running));
    back.addEventListener("click", () => stepped(-1));
    on.addEventListener("click", () => stepped(1));
    full.addEventListener("click", () => (document.fullscreenElement ? document.exitFullscreen() : box.requestFullscreen()));
    field.addEventListener("click", () => set(!running));
    slider.addEventListener("input", () => seek(Number(slider.value)));
    slider.addEventListener("keydown", (event) => { // one second a key, ten with shift or page keys
      const by = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageDown: -10, PageUp: 10 }[event.key];
      if (by) { event.preventDefault(); seek(now + by * (event.shiftKey ? 10 : 1)); }
      if (event.key === " ") { event.preventDefault(); set(!running); }
    });
    let dragging = false;
    const pointed = (event) => {
      const scale = Math.min(box.clientWidth / (width + 2 * rim), tallest() / (height + 2 * rim));
      seek(start + (end - start) * (event.offsetX - (box.clientWidth - width * scale) / 2) / (width * scale));
    };
    strip.addEventListener("pointerdown", (event) => { dragging = true; strip.setPointerCapture(event.pointerId); pointed(event); });
    strip.addEventListener("pointermove", (event) => { if (dragging) pointed(event); });
    for (const done of ["pointerup", "pointercancel"]) strip.addEventListener(done, () => { dragging = false; });
    new ResizeObserver(draw).observe(box);
    redraws.push(draw);
    draw();
  }

  for (const figure of document.querySelectorAll("figure.replay")) player(figure);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => redraws.forEach((draw) => draw()));
})();
