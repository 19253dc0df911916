// The report page: one run at a time, its film, its scene and its plots, all at the time of one clock.
import { Clock } from "./clock.js";
import { readData, unpack } from "./data.js";
import { drawPlots } from "./plots.js";
import { Film } from "./film.js";
import { Scene } from "./scene.js";

const find = (id) => document.getElementById(id);
const clock = new Clock();
let shown = { update() {}, dispose() {} };

function listOfFacts(rows) {
  const body = find("facts");
  body.replaceChildren(
    ...rows.map(([name, value]) => {
      const row = document.createElement("tr");
      for (const text of [name, value]) row.appendChild(document.createElement("td")).textContent = text;
      return row;
    }),
  );
}

async function show(run) {
  shown.dispose();
  shown = { update() {}, dispose() {} };
  document.body.dataset.ready = "";
  find("note").textContent = run.note;
  find("config").textContent = run.config;
  listOfFacts(run.facts);
  clock.setTimes(run.times);
  find("slider").max = run.times.length - 1;
  const plots = drawPlots(find("plots"), run, (frame) => clock.jump(frame));
  const blocks = await unpack(run);
  const film = new Film(find("film"), run, blocks.film, blocks.poster);
  const scene = await Scene.make(find("scene"), find("labels"), run, blocks).catch((error) => {
    find("note").textContent += ` The scene cannot be drawn here: ${error.message}`;
    return null;
  });
  shown = {
    update() {
      const frame = clock.frame;
      film.follow(clock);
      scene?.draw(frame, clock.times[frame]);
      plots.mark(frame);
      find("slider").value = frame;
      find("time").textContent = `${clock.time.toFixed(2)} s, frame ${run.first + frame + 1} of ${run.recorded}`;
      document.body.dataset.frame = frame;
    },
    dispose() {
      film.dispose();
      scene?.dispose();
    },
  };
  document.body.dataset.drawn = scene ? "yes" : "no";
  document.body.dataset.ready = "yes";
  for (const box of document.querySelectorAll("input[data-shows]")) {
    box.onchange = () => scene?.setVisible(box.dataset.shows, box.checked);
    box.onchange();
  }
  find("reset").onclick = () => scene?.resetView();
}

function listen(data) {
  const play = find("play");
  play.onclick = () => clock.toggle();
  clock.onchange = () => (play.textContent = clock.playing ? "Pause" : "Play");
  find("slider").oninput = (event) => clock.jump(Number(event.target.value));
  find("speed").onchange = (event) => (clock.speed = Number(event.target.value));
  document.onkeydown = (event) => {
    if (["INPUT", "SELECT", "BUTTON", "SUMMARY"].includes(event.target.tagName) && event.key === " ") return;
    const steps = { ArrowLeft: -1, ArrowRight: 1 };
    if (event.key === " ") clock.toggle();
    else if (event.key in steps && event.target.type !== "range") clock.jump(clock.frame + steps[event.key]);
    else return;
    event.preventDefault();
  };
  const choice = find("run");
  choice.append(...data.runs.map((run, i) => new Option(run.name, i)));
  choice.hidden = data.runs.length < 2;
  choice.onchange = () => show(data.runs[choice.value]);
}

function loop(now) {
  clock.tick(now);
  shown.update();
  requestAnimationFrame(loop);
}

readData().then((data) => {
  listen(data);
  show(data.runs[0]);
  requestAnimationFrame(loop);
});
