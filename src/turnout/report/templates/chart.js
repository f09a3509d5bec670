/* Zoom, values and series of the charts of a page. The SVG of each chart is complete without this script: numbers come
   from its paths, dots and data- attributes. Keys: arrows read values, + and - zoom, shift with arrows moves, 0 resets. */
(function () {
  "use strict";
  var all = Array.prototype, svgNamespace;
  function each(list, action) { all.forEach.call(list, action); }
  function make(name, attributes, parent) {
    var node = name.charAt(0) === "*" ? document.createElementNS(svgNamespace, name.slice(1)) : document.createElement(name);
    Object.keys(attributes).forEach(function (key) { node.setAttribute(key, attributes[key]); });
    if (parent) { parent.appendChild(node); }
    return node;
  }
  function axis(text) {
    var parts = text.split(" "), label = parts.slice(3).join(" "), log = parts[2] === "log";
    var map = log ? Math.log10 : function (v) { return v; }, low = map(+parts[0]), high = map(+parts[1]);
    var unit = /\[(.*)\]/.exec(label);
    return {
      scale: parts[2], name: label.replace(/ *\[.*\]/, "") || (parts[2] === "time" ? "date" : "value"), unit: unit ? " " + unit[1] : "",
      value: function (share) { var v = low + share * (high - low); return log ? Math.pow(10, v) : v; },
      share: function (value) { return (map(value) - low) / (high - low); }
    };
  }
  function date(seconds) { return new Date(1000 * seconds).toISOString().slice(0, 10); }
  function power(parts) {
    var exponent = parts[1].replace("+", "").replace(/./g, function (c) { return "⁰¹²³⁴⁵⁶⁷⁸⁹"[c] || "⁻"; });
    return (/^1(\.0*)?$/.test(parts[0]) ? "" : parts[0] + "·") + "10" + exponent;
  }
  function short(value, step) {
    var size = Math.abs(value), digits = step ? Math.max(0, Math.ceil(Math.log10(Math.max(size, step) / step) + 1)) : 4;
    if (size < 1e-300) { return "0"; }
    if (size >= 1e5 || size < 1e-3) { return power(value.toExponential(Math.min(4, Math.max(0, digits - 1))).split("e")); }
    return String(+value.toPrecision(Math.min(12, Math.max(1, digits))));
  }
  function words(axis, value) { return axis.scale === "time" ? date(value) : short(value) + axis.unit; }
  function ticks(axis, a, b) {
    var low = axis.value(a), high = axis.value(b), list = [], step, k;
    if (axis.scale === "log" && high / low > 4) {
      for (k = Math.floor(Math.log10(low)); k <= Math.log10(high); k += 1) {
        (high / low > 900 ? [1] : [1, 2, 5]).forEach(function (m) {
          var v = m * Math.pow(10, k);
          if (v >= low * 0.999 && v <= high * 1.001) { list.push([v, short(v, v)]); }
        });
      }
      return list;
    }
    step = (high - low) / 5;
    if (axis.scale === "time") { step = Math.max(1, Math.round(step / 86400)) * 86400; } else {
      k = Math.pow(10, Math.floor(Math.log10(step)));
      step = [1, 2, 5, 10].map(function (m) { return m * k; }).reduce(function (x, y) { return Math.abs(y - step) < Math.abs(x - step) ? y : x; });
    }
    for (k = Math.ceil(low / step); k * step <= high; k += 1) {
      list.push([k * step, axis.scale === "time" ? date(k * step) : short(k * step, step)]);
    }
    return list;
  }
  function points(path) {  // pairs of pixels of a line or band; lines of other shapes have no values
    var text = path.getAttribute("d"), list = [];
    if (/[VH]/i.test(text)) { return list; }
    text.split("M").filter(Boolean).forEach(function (piece) {  // a point, then steps in hundredths of a pixel
      var numbers = piece.match(/-?(\d+(\.\d+)?|\.\d+)/g), x = 0, y = 0, k;
      for (k = 0; k + 1 < numbers.length; k += 2) {
        x += Math.round(100 * numbers[k]);
        y += Math.round(100 * numbers[k + 1]);
        list.push([x / 100, y / 100]);
      }
    });
    return list;
  }
  function Plot(svg) {
    var plot = this, box = make("div", { "class": "plot", role: "group", tabindex: "0" });
    this.svg = svg;
    this.inner = svg.querySelector("svg[data-x]");
    this.x = axis(this.inner.dataset.x);
    this.y = axis(this.inner.dataset.y);
    ["x", "y", "width", "height"].forEach(function (key) { plot["_" + key] = +plot.inner.getAttribute(key); });
    this.zooms = this.x.scale !== "names";
    box.setAttribute("aria-label", svg.getAttribute("aria-label") + ". Chart: arrow keys read values" + (this.zooms ? ", plus and minus zoom, 0 shows all" : ""));
    svg.parentNode.insertBefore(box, svg);
    box.appendChild(svg);
    this.box = box;
    box.style.width = svg.getAttribute("width") + "px";
    this.view = [0, 1, 0, 1];
    this.bar = make("div", { "class": "plotbar" }, box);
    this.tip = make("div", { "class": "tip", role: "status" }, box);
    this.series();
    if (this.zooms) { this.buttons(); }
    this.listen();
  }
  Plot.prototype.series = function () {
    var plot = this, names = [], first = {};
    each(this.inner.querySelectorAll("[data-series]"), function (node) {
      var name = node.dataset.series;
      if (!first[name]) { names.push(name); }
      if (!first[name] || node.tagName === "g") { first[name] = node.querySelector("circle") || node; }
    });
    if (names.length < 2) { return; }
    this.box.classList.add("toggles");
    names.forEach(function (name) {
      var button = make("button", { type: "button", "aria-pressed": "true" }, plot.bar), swatch, kind = first[name].tagName;
      swatch = make("*svg", { width: 16, height: 10, "aria-hidden": "true" }, button);
      if (kind === "circle") { make("*circle", { "class": first[name].getAttribute("class"), cx: 8, cy: 5, r: 4 }, swatch); } else {
        make("*path", { "class": first[name].getAttribute("class"), d: /Z/.test(first[name].getAttribute("d")) ? "M0 0H16V10H0Z" : "M0 5H16" }, swatch);
      }
      button.appendChild(document.createTextNode(name));
      button.addEventListener("click", function () {
        var shown = button.getAttribute("aria-pressed") !== "true";
        button.setAttribute("aria-pressed", String(shown));
        each(plot.inner.querySelectorAll("[data-series]"), function (node) {
          if (node.dataset.series === name) { node.style.display = shown ? "" : "none"; }
        });
      });
    });
  };
  Plot.prototype.buttons = function () {
    var plot = this, group = make("span", { "class": "zoom" }, this.bar);
    [["+", "zoom in", 0.5], ["−", "zoom out", 2], ["all", "show all", 0]].forEach(function (item) {
      var button = make("button", { type: "button", "aria-label": item[1], title: item[1] }, group);
      button.textContent = item[0];
      button.addEventListener("click", function () { plot.zoom(item[2]); });
    });
  };
  Plot.prototype.zoom = function (factor, middle) {
    var v = this.view, centre = middle === undefined ? (v[0] + v[1]) / 2 : middle, half = factor * (v[1] - v[0]) / 2;
    this.show(factor ? [centre - half, centre + half, v[2], v[3]] : [0, 1, 0, 1]);
  };
  Plot.prototype.show = function (wanted) {
    var view = [];
    [0, 2].forEach(function (k) {  // within the data, at least a thousandth of them
      var size = Math.min(1, Math.max(1e-3, wanted[k + 1] - wanted[k]));
      view[k] = Math.max(0, Math.min(1 - size, wanted[k]));
      view[k + 1] = view[k] + size;
    });
    this.view = view;
    this.draw();
  };
  Plot.prototype.px = function (original) { return this._x + (original - this._x - this.view[0] * this._width) / (this.view[1] - this.view[0]); };
  Plot.prototype.py = function (original) {
    var bottom = this._y + this._height;
    return bottom - (bottom - original - this.view[2] * this._height) / (this.view[3] - this.view[2]);
  };
  Plot.prototype.draw = function () {
    var plot = this, v = this.view, sx = 1 / (v[1] - v[0]), sy = 1 / (v[3] - v[2]);
    var matrix = "matrix(" + [sx, 0, 0, sy, this.px(0), this.py(0)].join(" ") + ")";
    each(this.inner.querySelectorAll("path,rect,image"), function (node) { if (node !== plot.cross) { node.setAttribute("transform", matrix); } });
    each(this.inner.querySelectorAll("circle"), function (dot) {
      dot.dataset.cx = dot.dataset.cx || dot.getAttribute("cx");
      dot.dataset.cy = dot.dataset.cy || dot.getAttribute("cy");
      dot.setAttribute("cx", plot.px(+dot.dataset.cx));
      dot.setAttribute("cy", plot.py(+dot.dataset.cy));
    });
    each(this.inner.querySelectorAll("g[data-px]"), function (label) { label.setAttribute("transform", "translate(" + plot.px(+label.dataset.px) + " 0)"); });
    this.axes();
    this.hide();
  };
  Plot.prototype.axes = function () {
    var plot = this, groups = { x: this.svg.querySelector(".tick.x"), y: this.svg.querySelector(".tick.y") }, grid = this.svg.querySelector(".grid"), lines = "";
    if (!this.first) { this.first = [groups.x.innerHTML, groups.y.innerHTML, grid.getAttribute("d")]; }
    if (this.view.join() === "0,1,0,1") {
      groups.x.innerHTML = this.first[0]; groups.y.innerHTML = this.first[1]; grid.setAttribute("d", this.first[2]);
      return;
    }
    groups.x.textContent = groups.y.textContent = "";
    ticks(this.x, this.view[0], this.view[1]).forEach(function (tick) {
      var at = plot.px(plot._x + plot.x.share(tick[0]) * plot._width);
      make("*text", { x: Math.min(at, plot.svg.viewBox.baseVal.width - 1 - 3.1 * tick[1].length), y: plot._y + plot._height + 14 }, groups.x).textContent = tick[1];
      lines += "M" + at + " " + plot._y + "V" + (plot._y + plot._height);
    });
    ticks(this.y, this.view[2], this.view[3]).forEach(function (tick) {
      var at = plot.py(plot._y + (1 - plot.y.share(tick[0])) * plot._height);
      make("*text", { x: plot._x - 5, y: at + 3.5 }, groups.y).textContent = tick[1];
      lines += "M" + plot._x + " " + at + "H" + (plot._x + plot._width);
    });
    grid.setAttribute("d", lines);
  };
  Plot.prototype.prepare = function () {  // titles become words of the tip; the numbers of lines are read once
    if (this.lines) { return; }
    this.lines = [];
    this.marks = [];
    var plot = this;
    each(this.inner.querySelectorAll("path:not([data-span]),circle,rect"), function (node) {
      var title = node.querySelector("title"), at = node.tagName === "circle" ? [+(node.dataset.cx || node.getAttribute("cx")), +(node.dataset.cy || node.getAttribute("cy"))] :
        [+node.getAttribute("x") + node.getAttribute("width") / 2, +node.getAttribute("y")];
      if (node.tagName !== "path") {
        if (title) { plot.marks.push({ node: node, words: title.textContent, at: at }); title.remove(); }
        return;
      }
      if (title) { title.remove(); }
      if (node.dataset.series && points(node).length) { plot.lines.push({ node: node, name: node.dataset.series, points: points(node), band: /Z$/.test(node.getAttribute("d")) }); }
    });
    this.marks.sort(function (a, b) { return a.at[0] - b.at[0] || b.at[1] - a.at[1]; });
    this.cross = make("*path", { "class": "cross", d: "" }, this.inner);
  };
  function isShown(item) { return (item.node.closest("[data-series]") || item.node).style.display !== "none"; }
  Plot.prototype.value = function (py) { return this.y.value((this._y + this._height - py) / this._height); };
  Plot.prototype.read = function (px) {  // words of all series at a pixel of the chart as it was drawn
    var plot = this, nearest = null, texts = [];
    function closest(list) { return list.reduce(function (a, b) { return Math.abs(b[0] - px) < Math.abs(a[0] - px) ? b : a; }); }
    this.lines.filter(isShown).forEach(function (line) {
      var at = closest(line.points), turn, ends;
      if (Math.abs(at[0] - px) > 12 * (plot.view[1] - plot.view[0]) && line.points.length > 2) { return; }
      if (nearest === null || Math.abs(at[0] - px) < Math.abs(nearest - px)) { nearest = at[0]; }
      if (line.band) {
        turn = Math.ceil(line.points.length / 2);
        ends = [closest(line.points.slice(turn)), closest(line.points.slice(0, turn))].map(function (p) { return plot.value(p[1]); });
        texts.push([line.name, short(ends[0]) + " to " + short(ends[1]) + plot.y.unit]);
      } else { texts.push([line.name, words(plot.y, plot.value(at[1]))]); }
    });
    return nearest === null ? null : { px: nearest, head: this.x.name + ": " + words(this.x, this.x.value((nearest - this._x) / this._width)), texts: texts };
  };
  Plot.prototype.say = function (px, head, texts) {
    var tip = this.tip, ratio = this.svg.clientWidth / this.svg.viewBox.baseVal.width, at = this.px(px), left;
    tip.textContent = "";
    make(texts.length ? "b" : "span", {}, tip).textContent = head;
    texts.forEach(function (pair) { make("span", {}, tip).textContent = pair.filter(Boolean).join(": "); });
    this.cross.setAttribute("d", "M" + at + " " + this._y + "v" + this._height);
    tip.style.display = "block";
    left = at * ratio + 10;
    tip.style.left = Math.max(0, Math.min(left, this.svg.clientWidth - tip.offsetWidth)) + "px";
    tip.style.top = (this._y * ratio + 6) + "px";
    this.at = px;
  };
  Plot.prototype.hide = function () { this.tip.style.display = "none"; if (this.cross) { this.cross.setAttribute("d", ""); } };
  Plot.prototype.mark = function (item) { this.say(item.at[0], item.words, []); this.current = item; };
  Plot.prototype.locate = function (event) {
    var frame = this.svg.getBoundingClientRect(), ratio = this.svg.viewBox.baseVal.width / frame.width;
    return [(event.clientX - frame.left) * ratio, (event.clientY - frame.top) * ratio];
  };
  Plot.prototype.original = function (px) { return this._x + this.view[0] * this._width + (px - this._x) * (this.view[1] - this.view[0]); };
  Plot.prototype.hover = function (event) {
    var at = this.locate(event), plot = this, found = null, best = 196, reading;
    this.prepare();
    if (at[0] < this._x || at[0] > this._x + this._width || at[1] < this._y || at[1] > this._y + this._height) { this.hide(); return; }
    this.marks.filter(isShown).forEach(function (item) {
      var distance = Math.pow(plot.px(item.at[0]) - at[0], 2) + (item.node.tagName === "rect" ? 0 : Math.pow(plot.py(item.at[1]) - at[1], 2));
      if (distance < best) { best = distance; found = item; }
    });
    if (found) { this.mark(found); return; }
    reading = this.read(this.original(at[0]));
    if (reading) { this.say(reading.px, reading.head, reading.texts); } else { this.hide(); }
  };
  Plot.prototype.step = function (direction) {  // to the next dot, or to the next point of the first line
    var plot = this, marks, index, list, next, span = (this.view[1] - this.view[0]) * this._width, reading;
    this.prepare();
    marks = this.marks.filter(isShown).filter(function (item) { var at = plot.px(item.at[0]); return at >= plot._x - 1 && at <= plot._x + plot._width + 1; });
    if (marks.length) {
      index = marks.indexOf(this.current);
      this.mark(marks[index < 0 ? (direction > 0 ? 0 : marks.length - 1) : Math.max(0, Math.min(marks.length - 1, index + direction))]);
      return;
    }
    list = this.lines.filter(isShown)[0];
    if (!list) { return; }
    if (this.at === undefined) { this.at = this._x + this.view[0] * this._width; }
    next = list.points.map(function (p) { return p[0]; }).filter(function (px) { return direction * (px - plot.at) > span / 200; });
    if (next.length) { reading = this.read(direction > 0 ? Math.min.apply(null, next) : Math.max.apply(null, next)); }
    if (reading) { this.say(reading.px, reading.head, reading.texts); }
  };
  Plot.prototype.listen = function () {
    var plot = this, from = null, rubber;
    this.svg.addEventListener("pointermove", function (event) {
      if (!from) { plot.hover(event); return; }
      var at = plot.locate(event);
      rubber.setAttribute("d", "M" + from[0] + " " + from[1] + "H" + at[0] + "V" + at[1] + "H" + from[0] + "Z");
    });
    this.svg.addEventListener("pointerleave", function () { plot.hide(); });
    this.svg.addEventListener("pointerdown", function (event) {
      if (!plot.zooms || event.button || event.pointerType === "touch") { return; }
      from = plot.locate(event);
      rubber = make("*path", { "class": "rubber", d: "" }, plot.svg);
      plot.svg.setPointerCapture(event.pointerId);
      plot.hide();
    });
    this.svg.addEventListener("pointerup", function (event) {
      var to, v = plot.view, left = plot._x, bottom = plot._y + plot._height;
      if (!from) { return; }
      to = plot.locate(event);
      rubber.remove();
      function x(px) { return v[0] + (v[1] - v[0]) * (px - left) / plot._width; }
      function y(py) { return v[2] + (v[3] - v[2]) * (bottom - py) / plot._height; }
      if (Math.abs(to[0] - from[0]) > 8) {
        plot.show([x(Math.min(from[0], to[0])), x(Math.max(from[0], to[0]))].concat(
          Math.abs(to[1] - from[1]) > 20 ? [y(Math.max(from[1], to[1])), y(Math.min(from[1], to[1]))] : v.slice(2)));
      }
      from = null;
    });
    this.svg.addEventListener("dblclick", function () { if (plot.zooms) { plot.zoom(0); } });
    this.box.addEventListener("keydown", function (event) {
      if (event.target !== plot.box || event.ctrlKey || event.metaKey || event.altKey) { return; }
      var side = { ArrowRight: 1, ArrowLeft: -1 }[event.key], v = plot.view;
      if (side && event.shiftKey && plot.zooms) { plot.show([v[0] + side * (v[1] - v[0]) / 4, v[1] + side * (v[1] - v[0]) / 4, v[2], v[3]]); } else if (side) { plot.step(side); } else if (plot.zooms && (event.key === "+" || event.key === "=")) { plot.zoom(0.5); } else if (plot.zooms && event.key === "-") { plot.zoom(2); } else if (plot.zooms && event.key === "0") { plot.zoom(0); } else if (event.key === "Escape") { plot.hide(); } else { return; }
      event.preventDefault();
    });
    this.box.addEventListener("blur", function () { plot.hide(); });
  };
  each(document.querySelectorAll("svg.chart"), function (svg) {
    svgNamespace = svg.namespaceURI;
    if (svg.querySelector("svg[data-x]")) { svg.plot = new Plot(svg); }
  });
})();
