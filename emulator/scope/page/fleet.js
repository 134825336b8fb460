// Several ESCs: a button for each, which tells how it is and chooses it.

const digits = (value) => value.toFixed(1).replace(/^-(0\.0)$/, "$1");

export class Fleet {
  /** `chosen` hears the number of the ESC that a person wants to look at. */
  constructor(place, chosen) {
    Object.assign(this, { place, chosen, buttons: [] });
  }

  /** Offers these names, of which one is looked at. */
  offer(names, current) {
    this.place.hidden = names.length < 2;
    if (this.buttons.length !== names.length) {
      this.buttons = names.map((_, i) => {
        const button = document.createElement("button");
        button.append(document.createElement("b"), ...["rpm", "amps", "faults"].map((name) => {
          const part = document.createElement("span");
          part.className = name;
          return part;
        }));
        button.addEventListener("click", () => this.chosen(i));
        return button;
      });
      this.place.replaceChildren(...this.buttons);
    }
    for (const [i, button] of this.buttons.entries()) {
      button.firstChild.textContent = names[i];
      button.setAttribute("aria-pressed", i === current);
    }
  }

  tell(i, name, text) {
    const part = this.buttons[i]?.querySelector(`.${name}`);
    if (part && part.textContent !== text) part.textContent = text;
  }

  /** With a fault the bridge is off, and the speed is no more than a guess. */
  status(i, { rpm, current }, slot, isFaulty) {
    this.tell(i, "rpm", `${isFaulty ? "–" : rpm[slot]} rpm`);
    this.tell(i, "amps", `${digits(current[slot])} A`);
  }

  /** Nothing is known any more. */
  unknown() {
    for (const i of this.buttons.keys()) {
      for (const name of ["rpm", "amps"]) this.tell(i, name, "–");
      this.faults(i, []);
    }
  }

  faults(i, names) {
    this.tell(i, "faults", names.join(", "));
    this.buttons[i]?.classList.toggle("bad", names.length > 0);
  }
}
