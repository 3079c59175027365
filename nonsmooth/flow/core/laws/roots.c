/* Roots of switching functions -----------------------------------------------------------------------
 *
 * A field with |h|^p, 0 < p < 1, has no derivatives on h = 0, where the root is zero (lambda_i is zero there and
 * multiplies it). Taylor steps approach the surface as far as their series converge. The remaining distance, below the
 * tolerance, is a straight line with the mean of a field in which the root is a power of the time.
 */

/* The field of the present mode at a state, with the root of a surface or without; the rate of its h. */
static double field_at_root(Run *r, int i, const double *x, int with_root, double *field) {
  const Entries *g = &r->s->surface_gradient;
  double *unknowns = r->lam, rate = 0;
  memcpy(unknowns, r->unknowns, sizeof(double) * r->width);
  aim(r, r->letter, x, unknowns);
  held_of(r, r->letter);
  if (!with_root) { unknowns[i] = r->held[i]; r->held[i] = 0; }
  field_of(r, x, r->held, unknowns, field);
  surface_values(r, x);
  for (int k = 0; k < g->count; k++)
    if (g->row[k] == i) rate += out_of(&r->s->surfaces, r->heights, r->kept_rows + k) * field[g->column[k]];
  return rate;
}

/* The tolerance of h from that of the states, after surface_values. */
static double near_root(Run *r, int i) {
  double *allowed = r->vector;
  for (int k = 0; k < r->n; k++) allowed[k] = k < r->s->dimension ? SAFETY * (r->o.atol + r->o.rtol * fabs(r->x[k])) : 0;
  kept_sums(r, allowed, r->small);
  return r->small[i];
}

/* Whether a surface with a root is within the tolerance. */
static int nears_root(Run *r) {
  for (int i = 0; i < r->m; i++)
    if (element(r, i)->power > 0 && r->letter[i] && SAFETY * fabs(surface_values(r, r->x)[i]) <= near_root(r, i)) return 1;
  return 0;
}

/* Move along a line. */
static int move_by(Run *r, const double *field, double dt) {
  Expansion *e = &r->e;
  int64_t stride = r->stride;
  lay_out(r, r->letter, &e->l);
  memset(e->states, 0, sizeof(double) * r->n * stride);
  memset(e->series, 0, sizeof(double) * r->width * stride);
  for (int k = 0; k < r->n; k++) { e->states[k * stride] = r->x[k]; e->states[k * stride + 1] = field[k]; }
  for (int i = 0; i < e->l.slides; i++) e->series[e->l.sliding[i] * stride] = r->unknowns[e->l.sliding[i]];
  if (!advance(r, e, dt)) return 0;
  if (r->t >= r->o.t_end) { r->t = r->o.t_end; r->t_low = 0; set_time_state(r); }
  return 1;
}

/* Derivative along a field of the rate of h without its root. */
static double change_of_rate(Run *r, int i, double bare, const double *field) {
  double time = INFINITY, *x = r->at_root + r->n, *other = x + r->n;
  for (int k = 0; k < r->n; k++) if (field[k] != 0) time = smaller((size_of_state(r, k) + fabs(r->x[k])) / fabs(field[k]), time);
  if (!(time < INFINITY)) return 0;
  time *= REACH;
  for (int k = 0; k < r->n; k++) x[k] = r->x[k] + time * field[k];
  return (field_at_root(r, i, x, 0, other) - bare) / time;
}

/* Put the state where the function of a surface has a value. */
static void put_at(Run *r, int i, double height) {
  int32_t which = i;
  project_to(r, &which, 1, &height);
}

/* Whether a straight line crosses another surface with a root, beyond which the field differs. */
static int leads_beyond(Run *r, int i, const double *field, double dt) {
  double *x = r->at_root + r->n;
  for (int k = 0; k < r->n; k++) x[k] = r->x[k] + dt * field[k];
  const double *h = surface_values(r, x);
  for (int j = 0; j < r->m; j++) if (j != i && element(r, j)->power > 0 && r->letter[j] && !(h[j] * r->letter[j] >= 0)) return 1;
  return 0;
}

/* Pass the zero of the rate that balances a root; h is below the tolerance on both sides. Whether the surface is reached. */
static int pass_balance(Run *r, int i, double bare, const double *field, double left) {
  double change = change_of_rate(r, i, bare, field), dt = -2 * bare / change;
  if (!(change * bare < 0) || leads_beyond(r, i, field, dt)) return 0;
  move_by(r, field, smaller(dt, left));
  return dt < left;
}

/* Leave a surface with a slowly growing h, until h has the size ``level``; 0 where h does not grow. */
static int grow_off_root(Run *r, int i, double rate, const double *bare, double level, double left) {
  double change = change_of_rate(r, i, rate, bare), *with = r->at_root + 2 * r->n, own, dt, height = r->letter[i] * level;
  if (!(change * r->letter[i] > 0) || (rate * r->letter[i] < 0 && rate * rate > level * fabs(change))) return 0;
  memcpy(r->saved, r->x, sizeof(double) * r->n);
  put_at(r, i, height);
  own = fabs(field_at_root(r, i, r->x, 1, with) - rate); /* the root there */
  memcpy(r->x, r->saved, sizeof(double) * r->n);
  dt = larger((own - fabs(rate)) / fabs(change), sqrt(2 * level / fabs(change)));
  if (leads_beyond(r, i, bare, dt)) return 0;
  if (!move_by(r, bare, smaller(dt, left))) return 1;
  put_at(r, i, height);
  renote(r);
  return 1;
}

/* Time to the zero of h and mean field until then, if sliding multipliers of another surface follow the root, so that h is a
 * power above one of the time; 0 where the series contradict that. */
static double power_law(Run *r, int i, double *mean) {
  Expansion *e = &r->e;
  int row = 0;
  if (!r->now.slides) return 0;
  expand(r, r->letter, r->x, r->unknowns, e);
  while (row < e->l.rows && !(e->l.kind[row] == SURFACE_GUARD && e->l.index[row] == i)) row++;
  if (row == e->l.rows || !e->finite) return 0;
  const double *g = e->guards + (int64_t)row * r->stride;
  double q = 2 * g[0] * g[2] / (g[1] * g[1]), exponent = 1 / (1 - q), time = -exponent * g[0] / g[1];
  if (!(g[0] > 0 && g[1] < 0 && q > 0 && q < 1)) return 0;
  if (!(fabs(3 * g[3] * time + g[2] * (exponent - 2)) <= SHARE_SPREAD * g[2])) return 0;
  for (int k = 0; k < r->n; k++) {
    const double *x = e->states + (int64_t)k * r->stride;
    mean[k] = x[1] + 2 * x[2] * time * (1 - q);
  }
  return time;
}

/* Go to a near surface with a root; whether it is reached. */
static int approach_root(Run *r, int i, double h, double level, double left) {
  double p = element(r, i)->power, *with = r->before, *mean = r->at_root, own, bare, share = 0, rate, dt;
  if ((dt = power_law(r, i, mean)) > 0) {
    move_by(r, mean, smaller(dt, left));
    return dt < left;
  }
  own = field_at_root(r, i, r->x, 1, with);
  bare = field_at_root(r, i, r->x, 0, mean);
  int side = r->letter[i];
  if (bare * side > 0 && degree_of(r, i) == 1 && fabs(h) <= level) {
    if (pass_balance(r, i, bare, with, left)) return 1;
    if (h * side <= 0 && r->t < r->o.t_end) { /* rounding has put it beyond */
      put_at(r, i, side * level);
      renote(r);
    }
    return 0;
  }
  if (h * side <= 0) return 1;
  if (!(own * h < 0) || bare * h > 0) return 0;
  double part = fabs(h) <= least_time(r) * fabs(own) ? FALL : ROOT_SHARE; /* rounding in the time hides its square */
  if (fabs(own - bare) <= part * fabs(bare)) share = 1 / (1 + p); /* the root is a power p of the time */
  else if (fabs(bare) <= ROOT_SHARE * fabs(own)) share = 1 - p; /* h' = -k h^p */
  else if (fabs(h) <= level && degree_of(r, i) == 1) share = 1;
  if (share == 0) return 0;
  for (int k = 0; k < r->n; k++) mean[k] += share * (with[k] - mean[k]);
  rate = bare + share * (own - bare);
  dt = -h / rate;
  if (fabs(change_of_rate(r, i, bare, mean)) * dt > ROOT_SHARE * fabs(rate) || leads_beyond(r, i, mean, dt)) return 0;
  move_by(r, mean, smaller(dt, left));
  return dt < left;
}

/* Leave a surface with a root; 0 where the motion does not leave it. */
static int leave_root(Run *r, int i, double near, double level, double left) {
  double p = element(r, i)->power, *bare = r->before, *mean = r->at_root, *x = mean + r->n, *with = x + r->n;
  double rate = field_at_root(r, i, r->x, 0, bare), dt = near / fabs(rate);
  if (!(rate * r->letter[i] > 0)) return grow_off_root(r, i, rate, bare, level, left);
  for (double least = least_time(r) / FALL; ; dt *= FALL) { /* the root changes the rate by a small part */
    for (int k = 0; k < r->n; k++) x[k] = r->x[k] + dt * bare[k];
    if (fabs(field_at_root(r, i, x, 1, with) - rate) <= ROOT_SHARE * fabs(rate) || !(dt >= least)) break;
  }
  if (degree_of(r, i) == 1 && dt * fabs(rate) < level) {
    if (grow_off_root(r, i, rate, bare, level, left)) return 1;
    for (int k = 0; k < r->n; k++) x[k] = r->x[k] + dt * bare[k];
    field_at_root(r, i, x, 1, with);
  }
  for (int k = 0; k < r->n; k++) mean[k] = bare[k] + (with[k] - bare[k]) / (1 + p);
  move_by(r, mean, smaller(dt, left));
  return 1;
}

/* Rest on a surface with a root where it and its lower derivatives are below the tolerance: crossings need not
 * accumulate. */
static int rest_near_root(Run *r, int i) {
  int before = r->mode, first = element(r, i)->lower;
  int32_t own = i;
  double allowed, left, error;
  if (degree_of(r, i) == 1) return 0;
  allowed = KNOWN_TO / SAFETY * r->small[first];
  for (int k = first; k < first + degree_of(r, i) - 1; k++) if (fabs(r->rates[k]) > KNOWN_TO / SAFETY * r->small[k]) return 0;
  if (fabs(field_at_root(r, i, r->x, 1, r->before)) > allowed || is_awaited(r, 0) || !choose_rest(r, &own, 1, 0)) return 0;
  adopt(r, &r->chosen);
  note(r);
  left = block_of(r, &left, &error) ? left - r->since : 0;
  expand(r, r->letter, r->x, r->unknowns, &r->e);
  go_to_limit(r, left > 0 && r->e.finite && step_size(r, &r->e) >= left ? left : 0, REST, before);
  return 1;
}

/* Whether a surface in ``letter`` can be left to a side through its root alone: h' = k h^p with k > 0. */
static int is_driven_away(Run *r, int i, int side) {
  double *field = r->before, *with = r->at_root, terms = 0, level, bare, own;
  const Entries *g = &r->s->surface_gradient;
  r->letter[i] = (int8_t)side;
  bare = field_at_root(r, i, r->x, 0, field);
  for (int k = 0; k < g->count; k++)
    if (g->row[k] == i) terms += fabs(out_of(&r->s->surfaces, r->heights, r->kept_rows + k) * field[g->column[k]]);
  level = side * near_root(r, i);
  if (fabs(bare) > VANISHES * terms || level == 0) return 0;
  memcpy(r->saved, r->x, sizeof(double) * r->n);
  put_at(r, i, level);
  own = field_at_root(r, i, r->x, 1, with) - field_at_root(r, i, r->x, 0, field);
  memcpy(r->x, r->saved, sizeof(double) * r->n);
  return own * side > 0;
}

/* Whether a root drives the state off an active surface that r->chosen keeps or crosses. */
static int leaves_by_root(Run *r) {
  for (int q = 0; r->has_roots && q < r->active_count; q++) {
    int i = r->active[q];
    if (i >= r->m || element(r, i)->power == 0 || degree_of(r, i) != 1) continue;
    int8_t kept = r->letter[i];
    for (int side = 1; side >= -1; side -= 2) {
      int is_free = r->chosen.letter[i] != side && is_driven_away(r, i, side);
      r->letter[i] = kept;
      if (!is_free) continue;
      r->several[0] = mode_number(r->table, r->chosen.letter);
      r->chosen.letter[i] = (int8_t)side;
      r->several[1] = mode_number(r->table, r->chosen.letter);
      r->several_count = 2;
      memset(r->rates_of_several, 0, sizeof(double) * 2 * r->n);
      return 1;
    }
  }
  return 0;
}

/* How near a surface with a root a run may come: where |h| is at most ``near``, or no series can begin. */
static double least_of_root(Run *r, int i, double h, double near) {
  if (fabs(h) > larger(near, CLOSE * surface_scales(r, r->x)[i])) return near;
  return larger(near, least_time(r) * fabs(field_at_root(r, i, r->x, 1, r->at_root)));
}

/* Pass a surface with a root, where no series converges; whether the run has moved. */
static int pass_root(Run *r, double left) {
  for (int i = 0; i < r->m; i++) {
    if (element(r, i)->power == 0 || r->letter[i] == 0) continue;
    double h = surface_values(r, r->x)[i], near = least_of_root(r, i, h, near_root(r, i));
    if (!(fabs(h) <= near)) continue;
    if (rest_near_root(r, i)) return 1;
    double rounding = ON_SURFACE * surface_scales(r, r->x)[i], level = larger(ROOT_SHARE * ROOT_SHARE * near, rounding);
    int before = r->letter[i], is_there = r->since == 0 && fabs(h) <= rounding;
    if (is_there && leave_root(r, i, near, level, left)) return 1;
    if (!is_there && !approach_root(r, i, h, level, left)) {
      if (r->t >= r->o.t_end || r->status != RUNNING) return 1;
      continue;
    }
    for (int row = 0; row < r->now.rows && r->status == RUNNING; row++)
      if (r->now.kind[row] == SURFACE_GUARD && r->now.index[row] == i) { serve_between(r, row); break; }
    if (r->status == RUNNING && r->letter[i] == before && (is_there || !leave_root(r, i, near, level, r->o.t_end - r->t)))
      finish(r, STEP_TOO_SMALL, BRANCH_POINT, 0);
    return 1;
  }
  return 0;
}
