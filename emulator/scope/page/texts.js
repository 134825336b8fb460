// Texts of STATUSTEXT, of which a long one comes in pieces.

/** What a piece holds; one that is not full is the last. */
const FULL = 50;

export class Texts {
  /** `told` hears each whole text. */
  constructor(told) {
    this.told = told;
    this.open = new Map();
  }

  take({ component, severity, text, id, chunk_seq }) {
    const key = `${component} ${id}`;
    let whole = text;
    if (id !== 0 && chunk_seq > 0) {
      const { text: before, next } = this.open.get(key) ?? { text: "", next: 0 };
      // A lost piece leaves a mark.
      whole = before + (next === chunk_seq ? "" : "...") + text;
    }
    this.open.delete(key);
    if (id !== 0 && text.length === FULL) this.open.set(key, { text: whole, next: chunk_seq + 1 });
    else this.told({ component, severity, text: whole });
  }
}
