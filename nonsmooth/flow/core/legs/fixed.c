/* Flows of known durations: nonsmooth/flow/fixed.py -------------------------------------------------------- */

/* Size of the work array of a field. */
int64_t field_work(const Field *f) {
  int64_t stride = f->order + 1;
  int64_t numbers = f->columns * f->n + 2 * f->derivatives.count;
  return series_room(&f->series, stride) + (f->n * (1 + f->columns) + f->watched) * stride + f->n + numbers / 2 + 1;
}

/* Integrate z (n) along a smooth field for a duration of either sign. Returns the remaining time where the field is not
 * finite or steps are too small, else 0. */
double fixed_flow(const Field *f, const double *p, double *z, double duration, double tol, int64_t most_steps,
                  double *work) {
  Flow w = flow_of(f, p, duration, tol, work);
  run_whole_flow(&w, z, most_steps);
  return w.left;
}

/* Series of states and monitored functions at a state z, in rows (n + watched, order + 1). */
void fixed_terms(const Field *f, const double *p, const double *z, double *terms, double *work) {
  Flow w = flow_of(f, p, 0, 1, work);
  expand_flow(&w, z);
  memcpy(terms, w.states, sizeof(double) * (f->n + f->watched) * (f->order + 1));
}

/* Legs ----------------------------------------------------------------------------------------------------- */

/* Integrate all states to the ends of their legs. Returns the number of a failed leg, with its remaining time, or -1. */
int64_t run_legs(const Legs *l, double *a, double tol, int64_t most_steps, double *left) {
  return integrate_legs(l, a, tol, most_steps, left, run_whole_flow);
}

/* As run_legs in extended precision (``long double``), for residuals of equations solved to rounding. Results are rounded;
 * ``rest`` (results for each leg) has the remainders. */
int64_t run_legs_extended(const Legs *l, double *a, double tol, int64_t most_steps, double *left, double *rest) {
  int64_t room = 0;
  for (int64_t i = 0; i < l->count; i++) {
    room = room < field_work(l->field[i]) ? field_work(l->field[i]) : room;
    if (l->event[i] && l->event[i]->size > room) room = l->event[i]->size;
  }
  long double *all = calloc(l->work + room, sizeof(long double)), *found = all + l->events, over = 0;
  if (!all) return 0;
  for (int64_t k = 0; k < l->before; k++) all[k] = a[k];
  int64_t failed = integrate_legs_extended(l, all, tol, most_steps, &over, run_flow_extended);
  for (int64_t k = 0; k < l->count * l->results; k++) {
    a[l->events + k] = found[k];
    rest[k] = found[k] - (long double)(double)found[k];
  }
  *left = over;
  free(all);
  return failed;
}

/* Monitored functions ---------------------------------------------------------------------------------------- */

typedef struct { double *root; int count, room; } Roots;

/* Roots on (lo, hi] of a polynomial given its Bernstein coefficients there, in order. */
static void roots_in(const double *c, int n, double *b, double lo, double hi, int depth, Roots *found) {
  int changes = 0;
  for (int j = 0; j < n; j++) changes += (b[j] > 0) != (b[j + 1] > 0);
  if (!changes || found->count == found->room) return;
  if (changes == 1 || depth == DEPTH) {
    double up[P + 1], sign = b[0] > 0 ? 1 : -1;
    for (int k = 0; k <= n; k++) up[k] = sign * c[k];
    found->root[found->count++] = changes == 1 ? newton(up, n, lo, hi, 0.5 * (lo + hi)) : hi;
    return;
  }
  double left[P + 1], mid = 0.5 * (lo + hi);
  halve(b, n, left);
  roots_in(c, n, left, lo, mid, depth + 1, found);
  roots_in(c, n, b, mid, hi, depth + 1, found);
}

/* Extrema in (0, h] of a polynomial of degree n. */
static int extrema(const double *c, int n, double h, double *root, int room) {
  double slope[P + 1], b[P + 1], power = 1;
  Roots found = {root, 0, room};
  for (int k = 0; k < n; k++) {
    slope[k] = (k + 1) * c[k + 1];
    b[k] = slope[k] * power;
    power *= h;
  }
  bernstein(b, n - 1);
  roots_in(slope, n - 1, b, 0, h, 0, &found);
  return found.count;
}

/* Coefficients to order 3 of the states and of monitored functions. */
static void first_terms(const Flow *w, double *begin) {
  int64_t rows = w->field->n + w->field->watched, stride = w->field->order + 1;
  for (int64_t i = 0; i < rows; i++) memcpy(begin + 4 * i, w->states + i * stride, 4 * sizeof(double));
}

/* Values of monitored functions at their extrema and at the ends of steps, no nearer than ``margin`` to both ends of the
 * flow, and at that distance from them. Rows of ``found``: number, time, value, second derivative (0 where it is no
 * extremum), state. Returns their number, at most ``room``. First coefficients at the start go to ``begin``. */
static int64_t watch_flow(Flow *w, double *z, int64_t most_steps, double margin, double *found, int64_t room,
                          double *begin) {
  const Field *f = w->field;
  int64_t stride = f->order + 1, width = 4 + f->n, count = 0;
  double root[P + 2];
  for (int64_t step = 0; step < most_steps && w->left > 0; step++) {
    double h = next_step(w, z, step), t = w->whole - w->left, slope;
    if (step == 0) first_terms(w, begin);
    if (!(h > 0)) break;
    for (int j = 0; j < f->watched; j++) {
      const double *c = w->watched + j * stride;
      int many = extrema(c, f->order, h, root, P);
      root[many] = t + h >= w->whole - margin ? w->whole - margin - t : h;
      root[many + 1] = margin;
      for (int k = 0; k <= many + (step == 0); k++) {
        double s = root[k], bend = 0, *row = found + count * width;
        int inside = k < many ? margin < t + s && t + s < w->whole - margin : 0 < s && s <= h;
        if (!inside || count == room) continue;
        for (int i = f->order; i >= 2 && k < many; i--) bend = bend * s + i * (i - 1) * c[i];
        row[0] = j; row[1] = t + s; row[2] = horner(c, f->order, s, &slope); row[3] = bend;
        for (int i = 0; i < f->n; i++) row[4 + i] = horner(w->states + i * stride, f->order, s, &slope);
        count++;
      }
    }
    make_step(w, h, z);
  }
  end_flow(w);
  return count;
}

/* Values of monitored functions at a state. */
static void watched_at(Flow *w, const double *z, double *values) {
  const Field *f = w->field;
  const Series *t = &f->series;
  int64_t stride = f->order + 1;
  series_inputs(t, 0, z, w->rules);
  series_values(t, t->values.rule, t->values.count, stride, w->rules);
  for (int j = 0; j < f->watched; j++) values[j] = w->rules[t->output[f->n + j]];
}

/* watch_flow of many flows, with the margin ``ends`` times the duration: rows of all with the same width, their numbers in
 * ``counts``, first coefficients, each followed by values at the end of the leg. Flows without a positive duration have
 * coefficients only. Returns the number of a failed flow, with its remaining time, or -1; -2 where room is insufficient. */
int64_t watch_legs(const Field *const *fields, int64_t legs, int64_t width, const double *p, int64_t parameters, double *z,
                   const double *durations, double tol, int64_t most_steps, double ends, double *found, int64_t room,
                   int64_t *counts, double *begins, int64_t begin_width, double *left, double *work) {
  for (int64_t i = 0; i < legs; i++) {
    const Field *f = fields[i];
    Flow w = flow_of(f, p + i * parameters, durations[i], tol, work);
    counts[i] = 0;
    if (durations[i] > 0 && f->watched) {
      counts[i] = watch_flow(&w, z + i * width, most_steps, ends * w.whole, found, room, begins + i * begin_width);
      *left = w.left;
      if (w.left > 0 || w.left != w.left) return i;
      if (counts[i] == room) return -2;
      watched_at(&w, z + i * width, begins + i * begin_width + 4 * (f->n + f->watched));
    } else {
      expand_flow(&w, z + i * width);
      first_terms(&w, begins + i * begin_width);
    }
    found += counts[i] * (4 + f->n);
    room -= counts[i];
  }
  return -1;
}

/* Time until a monitored function passes zero in a direction; a start within ``still`` of zero does not count. -1 if it does
 * not within the duration, -2 where the flow ends before. z is the start of the last step. */
double fixed_march(const Field *f, const double *p, double *z, double duration, double tol, int64_t most_steps,
                   int32_t row, int32_t direction, double still, double *work) {
  Flow w = flow_of(f, p, duration, tol, work);
  int order = f->order;
  for (int64_t step = 0; step < most_steps && w.left > 0; step++) {
    double h = next_step(&w, z, step);
    if (!(h > 0)) break;
    const double *c = w.watched + (int64_t)row * (order + 1);
    int drop = 0;
    while (step == 0 && drop < order && !(fabs(c[drop]) > still)) drop++;
    double t = first_crossing(c + drop, order - drop, h, direction);
    if (t >= 0 && w.whole - w.left + t > 0) { end_flow(&w); return w.whole - w.left + t; }
    make_step(&w, h, z);
  }
  end_flow(&w);
  return w.left > 0 ? -2 : -1;
}
