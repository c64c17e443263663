// A questionnaire: a hint, questions one after the other, and a file of answers at the end. The page
// knows questions by tokens only. What was answered is kept in the browser, where that is allowed.

const STUDY = JSON.parse(document.getElementById("data").textContent);
const QUESTIONS = STUDY.questions;
const ANSWERS = ["x", "y", "neither", "both"];
const NAMES = ["A", "B", "X", "Y"];
const PLACE = `drawing-study ${STUDY.study}`; // in the browser's store
const REST = 250; // ms for which the mouse must rest on a picture before it comes nearer
let guard = 300; // ms for which a new question takes no answer: the last one's, pressed twice

const find = (id) => document.getElementById(id);
const sheets = [...document.querySelectorAll(".sheet")];
const choices = [...document.querySelectorAll("#answers button")];
const tabs = [...document.querySelectorAll("[data-large]")];

// ------------------------------------------------------------------------------------ what is kept

/** Read or write a text of the browser's store; null where it has none or does not let us. */
function stored(name, text) {
  try {
    if (text !== undefined) localStorage.setItem(name, text);
    return localStorage.getItem(name);
  } catch {
    return null;
  }
}

const keeps = stored(`${PLACE} try`, "yes") === "yes";
const worker = () => [...crypto.getRandomValues(new Uint8Array(8))].map((b) => b.toString(16).padStart(2, "0")).join("");
const fresh = () => ({ worker: worker(), at: -1, answers: QUESTIONS.map(() => null), seconds: QUESTIONS.map(() => 0), saved: false });

/** What was answered here before; anew where there is nothing, or what is no such thing. */
function restored() {
  try {
    const kept = JSON.parse(stored(`${PLACE} ${STUDY.questionnaire}`));
    const whole = kept.answers.length === QUESTIONS.length && kept.seconds.length === QUESTIONS.length
      && kept.answers.every((answer) => answer === null || ANSWERS.includes(answer))
      && kept.seconds.every((s) => s >= 0) && Number.isInteger(kept.at) && kept.at >= -1 && typeof kept.worker === "string";
    if (whole) return { ...fresh(), ...kept, at: Math.min(kept.at, firstOpen(kept.answers)) };
  } catch { /* nothing, or no such thing */ }
  return fresh();
}

/** The number of the first question without an answer. */
function firstOpen(answers) {
  const open = answers.indexOf(null);
  return open < 0 ? answers.length : open;
}

const state = restored();

function keep() {
  stored(`${PLACE} ${STUDY.questionnaire}`, JSON.stringify(state));
}

/** Who answers in this browser: one worker for all questionnaires of the study. */
function lastWorker() {
  try {
    return JSON.parse(stored(PLACE));
  } catch {
    return null;
  }
}

// -------------------------------------------------------------------------------- what is on screen

let since = 0; // when the clock of the question was last started, ms; 0: it stands
let ready = 0; // when the question begins to take answers, ms

/** Add the time since the clock was started to its question. */
function stopClock() {
  if (since) state.seconds[state.at] += (performance.now() - since) / 1000;
  since = 0;
}

function startClock() {
  const asked = state.at >= 0 && state.at < QUESTIONS.length;
  since = asked && document.visibilityState === "visible" ? performance.now() : 0;
}

/** Show the hint (-1), a question, or the end. */
async function show(at) {
  stopClock();
  at = Math.min(at, firstOpen(state.answers));
  state.at = at;
  keep();
  find("hint").hidden = at >= 0;
  find("question").hidden = at < 0 || at >= QUESTIONS.length;
  find("end").hidden = at < QUESTIONS.length;
  far();
  window.scrollTo(0, 0);
  const title = at < 0 ? "hint-title" : at < QUESTIONS.length ? "ask" : "end-title";
  if (at >= QUESTIONS.length) showEnd();
  else if (at >= 0) await showQuestion(at);
  if (at === state.at) find(title).focus({ preventScroll: true });
}

async function showQuestion(at) {
  ready = Infinity;
  find("place").textContent = `Question ${at + 1} of ${QUESTIONS.length}`;
  const answered = QUESTIONS.length - state.answers.filter((answer) => answer === null).length;
  find("progress").value = answered / QUESTIONS.length;
  find("progress").textContent = `${answered} of ${QUESTIONS.length}`;
  find("next").disabled = state.answers[at] === null;
  for (const choice of choices) choice.ariaPressed = String(choice.dataset.answer === state.answers[at]);
  // all four pictures change at once
  find("question").classList.add("turning");
  const images = sheets.map((sheet) => sheet.firstElementChild);
  images.forEach((image, i) => (image.src = STUDY.pictures[QUESTIONS[at].sheets[i]]));
  await Promise.allSettled(images.map((image) => image.decode()));
  if (state.at !== at) return;
  const [width, height] = [images[2].naturalWidth, images[2].naturalHeight];
  find("question").style.setProperty("--ratio", height / width);
  for (const sheet of sheets) sheet.style.aspectRatio = `${width} / ${height}`;
  find("question").classList.remove("turning");
  ready = performance.now() + guard;
  startClock();
}

function answer(choice) {
  const at = state.at;
  if (at < 0 || at >= QUESTIONS.length || performance.now() < ready) return;
  state.answers[at] = choice;
  show(at + 1);
}

function back() {
  if (state.at >= 0 && !state.saved) show(state.at - 1);
}

function forward() {
  if (state.at < 0) begin();
  else if (state.at < QUESTIONS.length && state.answers[state.at] !== null) show(state.at + 1);
}

// ------------------------------------------------------------------------------------- the pictures

let resting = 0;

/** Bring a picture nearer, at a place of it; B, X and Y show the same shape, and come together. */
function near(sheet, x, y) {
  const box = sheet.getBoundingClientRect();
  const at = [(x - box.left) / box.width, (y - box.top) / box.height];
  const together = sheet === sheets[0] ? [sheet] : sheets.slice(1);
  for (const each of together) {
    each.style.setProperty("--at-x", `${100 * at[0]}%`);
    each.style.setProperty("--at-y", `${100 * at[1]}%`);
    each.classList.add("near");
  }
}

/** Put all pictures back. */
function far() {
  clearTimeout(resting);
  resting = 0;
  for (const sheet of sheets) sheet.classList.remove("near");
}

for (const sheet of sheets) {
  sheet.addEventListener("pointermove", (event) => {
    if (event.pointerType !== "mouse") return;
    if (sheet.classList.contains("near")) return near(sheet, event.clientX, event.clientY);
    clearTimeout(resting);
    resting = setTimeout(near, REST, sheet, event.clientX, event.clientY);
  });
  sheet.addEventListener("pointerleave", far);
  sheet.addEventListener("click", () => enlarge(Number(sheet.dataset.sheet)));
}

/** Show a picture as large as the window. */
function enlarge(i) {
  far();
  find("large-image").src = sheets[i].firstElementChild.src;
  find("large-image").alt = sheets[i].firstElementChild.alt;
  tabs.forEach((tab, k) => (tab.ariaPressed = String(k === i)));
  if (!find("large").open) find("large").showModal();
  tabs[i].focus();
}

for (const tab of tabs) tab.addEventListener("click", () => enlarge(Number(tab.dataset.large)));
find("close").addEventListener("click", () => find("large").close());
find("large-image").addEventListener("click", () => find("large").close());

// -------------------------------------------------------------------------------------- the answers

/** Sum up the answers, so that a file changed by accident is noticed: FNV-1a, 32 bits. */
function seal(told) {
  const words = [STUDY.secret, told.study, told.questionnaire, told.worker, told.simulated ? "simulated" : "real"];
  for (const each of told.answers) words.push(`${each.question}:${each.answer}:${Math.floor(10 * each.seconds + 0.5)}`);
  let total = 0x811c9dc5;
  for (const byte of new TextEncoder().encode(words.join("|"))) total = Math.imul(total ^ byte, 0x01000193);
  return (total >>> 0).toString(16).padStart(8, "0");
}

/** The file's text: what was answered, and nothing about who did. */
function answersText() {
  const told = {
    format: "strokestyle study answers 1",
    study: STUDY.study,
    questionnaire: STUDY.questionnaire,
    worker: state.worker,
    simulated: false,
    answers: QUESTIONS.map((question, i) => ({
      question: question.id,
      answer: state.answers[i],
      seconds: Math.round(10 * state.seconds[i]) / 10,
    })),
  };
  return `${JSON.stringify({ ...told, seal: seal(told) })}\n`;
}

function showEnd() {
  if (STUDY.sendTo) find("send-to").textContent = STUDY.sendTo;
  find("text").value = answersText();
  find("again").hidden = state.saved;
}

function save() {
  if (firstOpen(state.answers) < QUESTIONS.length) return;
  const name = `answers-${STUDY.questionnaire}-${state.worker.slice(0, 6)}.json`;
  const address = URL.createObjectURL(new Blob([answersText()], { type: "application/json" }));
  const link = Object.assign(document.createElement("a"), { href: address, download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(address), 60_000);
  state.saved = true; // what was sent cannot be changed any more
  keep();
  showEnd();
  find("saved").textContent = `Saved as ${name}, where your browser puts downloads. Please send it off.`;
}

// --------------------------------------------------------------------------------- keys and buttons

function begin() {
  if (find("start").disabled) return;
  stored(PLACE, JSON.stringify({ worker: state.worker, questionnaire: STUDY.questionnaire }));
  show(0);
}

find("start").addEventListener("click", begin);
find("back").addEventListener("click", back);
find("again").addEventListener("click", back);
find("next").addEventListener("click", forward);
find("save").addEventListener("click", save);
find("text").addEventListener("focus", () => find("text").select());
for (const choice of choices) choice.addEventListener("click", () => answer(choice.dataset.answer));
find("somebody").addEventListener("click", () => {
  state.worker = worker();
  find("already").hidden = true;
  find("start").disabled = false;
  find("start").focus();
});

/** Do what a key is for; false where it is for nothing here. */
function pressed(event) {
  const step = { ArrowLeft: -1, ArrowRight: 1, Backspace: -1 }[event.key];
  if (find("large").open) {
    if (step) enlarge((tabs.findIndex((tab) => tab.ariaPressed === "true") + step + 4) % 4);
    else if (event.key === "Escape") find("large").close();
    else return false;
  } else if (step) {
    step < 0 ? back() : forward();
  } else {
    // where digits need Shift, the key that has them does
    const digit = /^([1-4])$/.exec(event.key) ?? /^(?:Digit|Numpad)([1-4])$/.exec(event.code);
    if (!digit || find("question").hidden) return false;
    answer(ANSWERS[digit[1] - 1]);
  }
  return true;
}

document.addEventListener("keydown", (event) => {
  if (event.repeat || event.ctrlKey || event.metaKey || event.altKey || event.target.id === "text") return;
  if (pressed(event)) event.preventDefault();
});

document.addEventListener("visibilitychange", () => {
  stopClock();
  keep();
  startClock();
});
window.addEventListener("pagehide", () => {
  stopClock();
  keep();
});
window.addEventListener("beforeunload", (event) => {
  if (!keeps && state.at >= 0 && !state.saved) event.preventDefault();
});

find("count").textContent = QUESTIONS.length;
find("minutes").textContent = Math.ceil(QUESTIONS.length / 6);
find("forgets").hidden = keeps;
const before = lastWorker();
if (before && before.questionnaire !== STUDY.questionnaire && state.at < 0) {
  state.worker = before.worker;
  find("already").hidden = false;
  find("start").disabled = true;
}
show(state.at).then(() => (document.documentElement.dataset.ready = "yes"));
