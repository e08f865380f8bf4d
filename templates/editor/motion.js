"use strict";
// A mechanism in motion: the generic kernels in WebAssembly, and the table that tells them which mechanism it is.

const STATUS = ["", "the position problem does not converge", "the equations are singular here; move a point a little", "a pivot became inaccurate",
  "a number is not finite", "the mechanism is too large", "interrupted", "the motion is stiff", "the steps became too short", "too many steps"];

class Motion {
  // bytes: of ncgen_generic.wasm, or its compiled module
  static async load(bytes) {
    const made = await WebAssembly.instantiate(bytes, {});
    return new Motion((made.instance ?? made).exports);
  }

  constructor(kernels) {
    this.kernels = kernels;
    kernels._initialize();
    const buffer = kernels.memory.buffer;
    const most = (this.most = kernels.ncgen_table_most_unknowns());
    this.numbers = new Float64Array(buffer, kernels.ncgen_table_numbers(), kernels.ncgen_table_most_numbers());
    const part = (k, count = most) => new Float64Array(buffer, kernels.ncgen_table_state() + 8 * k * most, count);
    [this.q, this.qd, this.qdd, this.multipliers, this.sizes] = [0, 1, 2, 3, 4].map((k) => part(k));
    this.energies = part(5, 4);
    this.t = 0;
  }

  // Begin at time t with a table, positions, velocities and natural sizes of the coordinates. Throws an Error that says why not.
  begin(table, q, qd, sizes, t = 0, rtol = 1e-11, atol = 1e-13) {
    if (table.length > this.numbers.length || q.length > this.most) throw new Error(STATUS[5]);
    this.numbers.set(table);
    this.q.set(q);
    this.qd.set(qd);
    this.sizes.set(sizes);
    this.t = t;
    this.check(this.kernels.ncgen_table_begin(table.length, t, rtol, atol));
  }

  projectState() {
    this.check(this.kernels.ncgen_table_project_state());
  }

  goOn(end) {
    this.check(this.kernels.ncgen_table_advance(end));
    this.t = end;
  }

  get rank() {
    return this.kernels.ncgen_table_rank();
  }

  check(status) {
    if (status) throw new Error(STATUS[status] ?? `status ${status}`);
  }
}
