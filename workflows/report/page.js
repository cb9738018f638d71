"use strict";
const data = JSON.parse(document.getElementById("data").textContent);
const config = { responsive: true, displaylogo: false };

for (const holder of document.querySelectorAll("[data-chart]")) {
  const chart = data.charts[holder.dataset.chart];
  Plotly.newPlot(holder, chart.data, chart.layout, config);
}

function bounds(values) {
  const known = values.filter((v) => v !== null);
  const low = Math.min(...known), high = Math.max(...known);
  return high > low ? [low, high] : [low, low + 1];
}

function xyz([x, y, z]) { return { x, y, z }; }

function viewer(holder) {
  const solid = data.solids[Number(holder.dataset.solid)];
  const plot = holder.querySelector(".solid"), slider = holder.querySelector(".state");
  const field = holder.querySelector(".field"), open = holder.querySelector(".open");
  slider.max = slider.value = solid.states.length - 1;
  for (const name of Object.keys(solid.states[0].fields)) field.add(new Option(name, name));
  const several = Boolean(solid.body && solid.body.apart);
  if (!several) holder.querySelector(".opener").remove();
  const apart = () => several && open.checked;

  function traces() {
    const state = solid.states[Number(slider.value)], found = [];
    if (solid.body) {
      const places = solid.body.xyz.map((axis) => axis.slice());
      state.moved[0].forEach((n, k) => { for (let a = 0; a < 3; a++) places[a][n] = state.moved[1][k][a]; });
      if (apart()) for (let a = 0; a < 3; a++) places[a] = places[a].map((v, n) => v + solid.body.apart[a][n]);
      const [x, y, z] = places, [i, j, k] = solid.body.ijk;
      found.push({ type: "mesh3d", name: "part", x, y, z, i, j, k, color: "#c9ced6", flatshading: true,
        hoverinfo: "skip", lighting: { ambient: 0.6, diffuse: 0.6, specular: 0 } });
    }
    const values = state.fields[field.value], isStatus = field.value === "status";
    const [low, high] = isStatus ? [0, 8] : bounds(values);
    const scale = [];
    if (isStatus) {
      for (let bits = 0; bits < 8; bits++) {
        const color = solid.status[bits] ? solid.status[bits][1] : "#ffffff";
        scale.push([bits / 8, color], [(bits + 1) / 8, color]);
      }
    }
    state.faces.forEach((xyz, number) => {
      const side = solid.sides[number], own = side.pairs.map((p) => values[p]), [i, j, k] = side.ijk;
      const [x, y, z] = apart() && side.apart ? xyz.map((axis, a) => axis.map((v) => v + side.apart[a])) : xyz;
      found.push({ type: "mesh3d", name: "face " + (number + 1), x, y, z, i, j, k,
        intensity: isStatus ? own.map((v) => v + 0.5) : own, cmin: low, cmax: high,
        colorscale: isStatus ? scale : "Viridis", showscale: !isStatus && number === 0,
        colorbar: { title: { text: field.value, side: "right" }, thickness: 14, len: 0.8 },
        text: isStatus ? own.map((v) => (solid.status[v] || ["none"])[0]) : own.map(String), hoverinfo: "text",
        lighting: { ambient: 1, diffuse: 0, specular: 0 } });
    });
    holder.querySelector(".label").textContent = state.label + (solid.worn ? ", depth drawn × " + solid.factor : "");
    holder.querySelector(".legend").innerHTML = !isStatus ? "" : [...new Set(values)].sort().map((bits) => {
      const [name, color] = solid.status[bits] || ["none", "#ffffff"];
      return '<span><i style="background:' + color + '"></i>' + name + "</span>";
    }).join("");
    return found;
  }

  const zoom = plot.clientWidth < 1.3 * plot.clientHeight ? 1 : 1.7;  // a parallel view is zoomed by its ratios alone
  const axis = { showbackground: false, gridcolor: "#e6e8eb", color: "#4a515c" };
  const layout = { margin: { l: 0, r: 0, t: 0, b: 0 }, uirevision: "kept", scene: { uirevision: "kept",
    aspectmode: "manual", aspectratio: xyz(solid.extent.map((v) => zoom * v)),
    xaxis: { ...axis, title: { text: "x / mm" } }, yaxis: { ...axis, title: { text: "y / mm" } },
    zaxis: { ...axis, title: { text: "z / mm" } }, camera: { projection: { type: "orthographic" }, eye: xyz(solid.camera[0]), up: xyz(solid.camera[1]) } } };
  const draw = () => Plotly.react(plot, traces(), layout, config);
  Plotly.newPlot(plot, traces(), layout, config);
  slider.addEventListener("input", draw);
  for (const control of [field, open]) if (control) control.addEventListener("change", draw);
}

const webgl = document.createElement("canvas").getContext("webgl") !== null;
document.querySelectorAll("[data-solid]").forEach((holder) => {
  if (webgl) viewer(holder);
  else holder.textContent = "This browser has no WebGL: the pictures of the part are above it and among the figures below.";
});
window.reportReady = true;
