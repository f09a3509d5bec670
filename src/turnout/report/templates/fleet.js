(function () {
  "use strict";
  var table = document.getElementById("fleet"), body = table.tBodies[0], heads = table.tHead.rows[0].cells;
  var filter = document.getElementById("filter"), shown = document.getElementById("shown");
  function text(row, column) { return row.cells[column].textContent.trim(); }
  function key(row, column) { return row.cells[column].dataset.key || text(row, column); }
  function compare(a, b) {
    var x = parseFloat(a), y = parseFloat(b), number = /^-?[0-9.]+( of [0-9]+)?$/;
    return number.test(a) && number.test(b) ? x - y : a.localeCompare(b, undefined, { numeric: true });
  }
  Array.prototype.forEach.call(heads, function (head, column) {
    head.firstChild.addEventListener("click", function () {
      var direction = head.getAttribute("aria-sort") === "ascending" ? -1 : 1;
      var rows = Array.prototype.slice.call(body.rows);
      rows.sort(function (a, b) { return direction * compare(key(a, column), key(b, column)); });
      rows.forEach(function (row) { body.appendChild(row); });
      Array.prototype.forEach.call(heads, function (other) { other.removeAttribute("aria-sort"); });
      head.setAttribute("aria-sort", direction > 0 ? "ascending" : "descending");
    });
  });
  var state = "", cards = document.querySelectorAll("button.card");
  function show() {
    var words = filter.value.toLowerCase(), count = 0;
    Array.prototype.forEach.call(body.rows, function (row) {
      row.hidden = row.textContent.toLowerCase().indexOf(words) < 0 || (state && text(row, 0) !== state);
      if (!row.hidden) { count += 1; }
    });
    shown.textContent = words || state ? count + " of " + body.rows.length + " shown" : "";
  }
  filter.addEventListener("input", show);
  Array.prototype.forEach.call(cards, function (card) {
    card.addEventListener("click", function () {
      state = state === card.dataset.state ? "" : card.dataset.state;
      Array.prototype.forEach.call(cards, function (other) { other.setAttribute("aria-pressed", String(other.dataset.state === state)); });
      show();
      if (state) { document.getElementById("turnouts").scrollIntoView(); }
    });
  });
  document.getElementById("csv").addEventListener("click", function () {
    function field(words) {
      if (/^[=+@\t\r-]/.test(words)) { words = "'" + words; }
      return '"' + words.replace(/"/g, '""') + '"';
    }
    var rows = [table.tHead.rows[0]].concat(Array.prototype.slice.call(body.rows));
    var lines = rows.filter(function (row) { return !row.hidden; }).map(function (row) {
      return Array.prototype.map.call(row.cells, function (cell) { return field(cell.textContent.trim()); }).join(",");
    });
    var link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob(["\ufeff" + lines.join("\r\n")], { type: "text/csv" }));
    link.download = "turnouts.csv";
    link.click();
    URL.revokeObjectURL(link.href);
  });
})();
