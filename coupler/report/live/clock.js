// One time for the whole page: every chart, the player and the contact lines show it and may set it.

/**
 * Holds the time cursor [s], the range of time that charts show, and the choices of the player.
 *
 * All of it is kept in the address behind "#", so that a page which is renewed while its run goes on stays as it was.
 */
class Clock {
  constructor(first, last) {
    this.whole = [first, last];
    this.listeners = [];
    this.state = Object.fromEntries(new URLSearchParams(location.hash.slice(1)));
    this.t = this.number("t", last);
    this.range = [this.number("from", first), this.number("to", last)];
    if (!(this.range[1] > this.range[0])) this.range = [...this.whole];
  }

  number(key, otherwise) {
    const value = Number.parseFloat(this.state[key]);
    return Number.isFinite(value) ? Math.min(Math.max(value, this.whole[0]), this.whole[1]) : otherwise;
  }

  /** Calls the listener after every change, and once now. */
  listen(listener) {
    this.listeners.push(listener);
    listener(this);
  }

  setTime(t) {
    this.t = Math.min(Math.max(t, this.whole[0]), this.whole[1]);
    this.keep("t", this.t === this.whole[1] ? null : this.t);
    this.tell();
  }

  /** Shows a range of time in all charts; without one the whole run. */
  setRange(range) {
    const [first, last] = this.whole;
    const [from, to] = range || this.whole;
    const least = 1e-6 * (last - first);
    this.range = to - from > least ? [Math.max(from, first), Math.min(to, last)] : [...this.whole];
    const all = this.range[0] === first && this.range[1] === last;
    this.keep("from", all ? null : this.range[0]);
    this.keep("to", all ? null : this.range[1]);
    this.tell();
  }

  /** Zooms by a factor about the time cursor, or about the middle where the cursor is outside. */
  zoom(factor) {
    const [from, to] = this.range;
    const about = this.t >= from && this.t <= to ? this.t : (from + to) / 2;
    this.setRange([about - (about - from) * factor, about + (to - about) * factor]);
  }

  /** Remembers a choice in the address; null forgets it. */
  keep(key, value) {
    if (value === null) delete this.state[key];
    else this.state[key] = typeof value === "number" ? String(Number(value.toPrecision(12))) : value;
    history.replaceState(null, "", `#${new URLSearchParams(this.state)}`);
  }

  tell() {
    for (const listener of this.listeners) listener(this);
  }
}
