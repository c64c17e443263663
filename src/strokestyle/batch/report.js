const find = (id) => document.getElementById(id);
const sheet = find("sheet");
const cards = [...sheet.children];
const state = { show: "all", turned: false };

// what a card is found by: all that is written on it
const text = new Map(cards.map((card) => [card, card.querySelector(".told").textContent.toLowerCase()]));
const collator = new Intl.Collator(undefined, { numeric: true, sensitivity: "base" });

function shown(card) {
  if (state.show !== "all" && !card.dataset.is.split(" ").includes(state.show)) return false;
  const words = find("search").value.toLowerCase().split(/\s+/).filter(Boolean);
  return words.every((word) => text.get(card).includes(word));
}

function compare(key) {
  const way = state.turned ? -1 : 1;
  if (key === "order") return (a, b) => way * (cards.indexOf(a) - cards.indexOf(b));
  if (key === "name") return (a, b) => way * collator.compare(a.dataset.name, b.dataset.name);
  // most first; what has none is last, whichever way
  const value = (card) => (card.dataset[key] === undefined ? NaN : Number(card.dataset[key]));
  return (a, b) => {
    const x = value(a), y = value(b);
    if (isNaN(x) || isNaN(y)) return isNaN(x) - isNaN(y);
    return way * (y - x);
  };
}

function order() {
  sheet.append(...[...cards].sort(compare(find("sort").value)));
}

function filter() {
  let count = 0;
  for (const card of cards) {
    card.hidden = !shown(card);
    count += !card.hidden;
  }
  find("none").hidden = count > 0;
  find("shown").textContent = count === cards.length ? `${count}` : `${count} of ${cards.length}`;
}

find("search").addEventListener("input", filter);
find("sort").addEventListener("change", order);
find("size").addEventListener("input", (event) => document.documentElement.style.setProperty("--size", `${event.target.value}px`));
find("turn").addEventListener("click", (event) => {
  state.turned = !state.turned;
  event.currentTarget.setAttribute("aria-pressed", state.turned);
  order();
});
for (const button of find("filters").children) {
  button.addEventListener("click", () => {
    state.show = button.dataset.show;
    for (const other of find("filters").children) other.setAttribute("aria-pressed", other === button);
    filter();
  });
}
find("tools").addEventListener("submit", (event) => event.preventDefault());
find("tools").hidden = false;
filter();
document.documentElement.dataset.ready = "yes";
