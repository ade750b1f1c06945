(function () {
  "use strict";
  var form = document.querySelector("form.filters"), shown = form.querySelector("output");
  var rows = Array.prototype.slice.call(document.querySelectorAll("table.matrix > tbody > tr"));
  var chunks = Array.prototype.slice.call(document.querySelectorAll("section.chunk"));
  var states = rows.map(function (row) { return " " + row.dataset.s + " "; });
  var texts = [], timer = 0;
  function text(at) {
    if (texts[at] === undefined) { texts[at] = rows[at].textContent.toLowerCase(); }
    return texts[at];
  }
  function apply() {
    var words = form.words.value.toLowerCase().split(/\s+/).filter(Boolean), count = 0;
    var close = form.close.value, comply = form.comply.value, reason = form.reason.value;
    rows.forEach(function (row, at) {
      var state = states[at].split(" ");
      var good = (!close || state[1] === close) && (!comply || state[2] === comply) &&
        (!reason || states[at].indexOf(" " + reason + " ") >= 0) &&
        words.every(function (word) { return text(at).indexOf(word) >= 0; });
      if (row.hidden === good) { row.hidden = !good; }
      count += good;
    });
    chunks.forEach(function (chunk) { chunk.hidden = !chunk.querySelector("tbody > tr:not([hidden])"); });
    shown.textContent = count === rows.length ? rows.length + " requirements" : count + " of " + rows.length + " shown";
  }
  function reveal() {
    var row = document.getElementById(decodeURIComponent(location.hash.slice(1)));
    if (row && row.hidden) { form.reset(); apply(); row.scrollIntoView(); }
  }
  form.hidden = false;
  form.addEventListener("submit", function (event) { event.preventDefault(); });
  form.addEventListener("reset", function () { setTimeout(apply, 0); });
  form.addEventListener("change", apply);
  form.words.addEventListener("input", function () { clearTimeout(timer); timer = setTimeout(apply, 150); });
  document.querySelectorAll("a[data-code]").forEach(function (link) {
    link.addEventListener("click", function () { form.reset(); form.reason.value = link.dataset.code; apply(); });
  });
  window.addEventListener("hashchange", reveal);
  apply();
}());
