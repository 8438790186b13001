// Puts the page together: charts over time, the player, contact lines, one clock for all.

/** Keys of every chart over time. */
function timeKeys(clock, times) {
  return (event) => {
    const at = nearest(times, clock.t), last = times.length - 1;
    const act = { ArrowLeft: () => clock.setTime(times[Math.max(at - 1, 0)]),
      ArrowRight: () => clock.setTime(times[Math.min(at + 1, last)]),
      Home: () => clock.setTime(times[0]), End: () => clock.setTime(times[last]),
      "+": () => clock.zoom(0.6), "-": () => clock.zoom(1.667), 0: () => clock.setRange(null),
      Escape: () => clock.setRange(null) }[event.key];
    if (!act) return;
    event.preventDefault();
    act();
  };
}

function timePlot(host, data, clock, chart) {
  const x = data.numbers(chart.t);
  const plot = new Plot(host, { x, xLabel: "time [s]", yLabel: chart.label, label: chart.alt, marks: data.meta.marks,
    height: chart.height, series: chart.series.map((s) => ({ name: s.name, y: data.numbers(s.values),
      band: s.band && data.numbers(s.band) })),
    pick: (t) => clock.setTime(t), zoom: (range) => clock.setRange(range), keys: timeKeys(clock, x) });
  clock.listen((now) => {
    if (plot.range[0] !== now.range[0] || plot.range[1] !== now.range[1]) plot.setRange([...now.range]);
    plot.setCursor(now.t);
  });
  return plot;
}

/** Contact along the slave surface of a pair at the time of the cursor: one chart a quantity. */
function linePlots(host, data, clock, line) {
  const s = data.numbers(line.s), times = data.numbers(line.t);
  const title = element("span"), own = element("input", { type: "checkbox", onchange: () => show(shown) });
  host.append(element("div", { class: "row choices said" }, title,
    element("label", { title: "From the least to the largest value of this time, not of all times" }, own, " scale of this time")));
  const plots = line.fields.map((group) => {
    const rows = group.curves.map((curve) => tableOf(curve.values, data.numbers));
    const plot = new Plot(host, { x: s, xLabel: line.label, yLabel: group.label, height: 210, digits: 4,
      label: `${group.label} along ${line.slave} at the time of the cursor`,
      series: group.curves.map((curve, k) => ({ name: curve.name, y: rows[k][0] })) });
    return { plot, rows, whole: [group.low, group.high] };
  });
  let shown = -1;
  const show = (row) => {
    shown = row;
    const alone = line.fields.some((f) => f.label.startsWith("gap"))
      && !plots.at(-1).rows[0][row].some((gap) => Number.isFinite(gap));
    title.textContent = `${line.pair}: along ${line.slave} at t = ${shownNumber(times[row], 7)} s`
      + (line.pressed ? "" : "; the pressure is 0 throughout the run")
      + (alone ? "; no node faces the other surface at this time" : "");
    for (const { plot, rows, whole } of plots) {
      plot.fixed = own.checked ? null : whole;
      plot.setData(s, rows.map((of) => of[row]));
    }
  };
  clock.listen((now) => {
    const row = nearest(times, now.t);
    if (row !== shown) show(row);
  });
  return { plots: plots.map(({ plot }) => plot), pressed: (t) => line.nodes.filter((_, k) => {
    return line.pressed && plots[0].rows[0][nearest(times, t)][k] > 0;
  }) };
}

/** The least and the largest value of the field that is shown, of every window: also a way to go to a time. */
function extremesPlot(host, data, clock, player) {
  const first = data.meta.fields.find((field) => field.extremes);
  if (!first) return null;
  // One chart for all fields: those that were chosen before would listen to the clock for ever.
  const series = [["largest anywhere", 1], ["least anywhere", 0]];
  const plot = timePlot(host, data, clock, { t: data.meta.extremes_t, label: "", height: 150, alt: "",
    series: series.map(([name, c]) => ({ name, values: first.extremes[c] })) });
  player.onField = (field) => {
    host.hidden = !field.extremes;
    if (!field.extremes) return;
    plot.yLabel = field.unit;
    plot.svg.setAttribute("aria-label", `Largest and least ${field.title} of every window`);
    plot.setData(plot.x, series.map(([, c]) => data.numbers(field.extremes[c])));
    plot.setCursor(clock.t);
  };
  player.chooseField();
  return plot;
}

async function start() {
  const data = await readPage();
  const clock = new Clock(...data.meta.span);
  document.documentElement.classList.add("live");
  const charts = [...document.querySelectorAll("[data-chart]")].map((host) =>
    timePlot(host, data, clock, data.meta.charts[Number(host.dataset.chart)]));
  const lines = [...document.querySelectorAll("[data-line]")].map((host) =>
    linePlots(host, data, clock, data.meta.lines[Number(host.dataset.line)]));
  const host = document.getElementById("player");
  if (host && data.meta.frames) {
    const player = new Player(host, data, clock);
    player.pressed = (t) => lines.map((line) => line.pressed(t));
    const under = document.getElementById("extremes-chart");
    const extremes = under && extremesPlot(under, data, clock, player);
    if (extremes) charts.push(extremes);
    window.addEventListener("beforeprint", () => player.pause());
  }
  // Paper is narrower than a screen: charts that were only made smaller would have letters that nobody reads.
  const plots = [...charts, ...lines.flatMap((line) => line.plots)];
  window.addEventListener("beforeprint", () => { for (const plot of plots) plot.drawFor(PAPER); });
  window.addEventListener("afterprint", () => { for (const plot of plots) plot.drawFor(null); });
  const again = Number(document.documentElement.dataset.renew);
  // A running run: the page is written anew, and what was chosen stands in the address.
  if (again > 0) setTimeout(() => location.reload(), 1000 * again);
  document.documentElement.dataset.ready = "yes";
}

start();
