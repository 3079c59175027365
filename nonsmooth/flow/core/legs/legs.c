/* Legs of known duration, forward with columns (variation.c) and back with rows (adjoint.c): nonsmooth/flow/variation.py. */

/* Enter the mode of a leg at its start; h of sets that the mode is off is integrated. 0 where its unknowns are not unique. */
static int begin_leg(Run *r, const Leg *l) {
  memcpy(r->x, l->x, sizeof(double) * r->n);
  set_time_state(r);
  memcpy(r->letter, l->letter, r->width);
  find_idle(r);
  const double *h = surface_values(r, r->x);
  EACH_SET(r, f) {
    if (r->letter[f] == 0) continue;
    int k = size_of(r, f), stays = r->idle[f] && !(length_of(h + f, k) > 0); /* a parameter may make friction act */
    stays |= is_unloaded(r, r->letter, f, 0);
    for (int i = f; i < f + k; i++) {
      r->letter[i] = stays ? IDLE : r->letter[i] == OFF ? LEFT_BEHIND : LEAVING;
      r->unknowns[i] = h[i];
    }
  }
  lay_out(r, r->letter, &r->now);
  return find_unknowns(r, &r->now) == 1;
}

/* Advance state, unknowns and columns by a step. */
static void move_columns(Run *r, const Leg *l, const Variation *v, double dt) {
  const Expansion *e = &r->e;
  int n = r->n, w = r->width, m = r->m, order = r->order, stride = r->stride;
  at_time(r, e, dt, r->x, r->unknowns);
  for (int64_t k = 0; k < l->columns; k++) {
    for (int i = 0; i < n; i++) l->y[k * n + i] = value_at(v->of_states + (k * n + i) * stride, order, dt);
    for (int i = 0; i < m; i++)
      if (set_of(r, i) >= 0 && r->letter[i]) v->h[k * m + i] = value_at(v->of_series + (k * w + i) * stride, order, dt);
  }
  for (int i = 0; i < m; i++) if (r->letter[i] == LEAVING) r->letter[i] = LEFT_BEHIND;
  lay_out(r, r->letter, &r->now);
  improve(r, &r->now, r->x, r->unknowns, 2);
}

/* Whether a set is reached to rounding. */
static int has_arrived(const Run *r, int f, double *most) {
  int k = size_of(r, f);
  double rate[3], radius = length_of(r->unknowns + f, k);
  for (int i = 0; i < k; i++) rate[i] = r->e.series[(int64_t)(f + i) * r->stride + 1];
  *most = larger(radius, *most);
  return r->letter[f] == LEFT_BEHIND && radius < larger(ARRIVED * *most, TENFOLD * shortest(r) * length_of(rate, k));
}

/* Shorten a step so that |h| of a set falls tenfold at most. */
static double near_step(const Run *r, int f, double h) {
  const Expansion *e = &r->e;
  for (int row = 0; row < e->l.rows; row++) {
    if (e->l.kind[row] != NEAR_GUARD || e->l.index[row] != f || r->letter[f] == LEAVING) continue;
    double root = first_root(e->guards + (int64_t)row * r->stride, r->order, h);
    if (root > 0) return root;
  }
  return h;
}

/* Sample columns at times within a step, or at the end of the leg, from ``sample`` on. */
static void read_columns(const Run *r, const Leg *l, const Variation *v, double begun, double dt, int64_t *sample) {
  double sign = way_of_leg(l), end = begun + dt + 4 * EPSILON * length_of_leg(l);
  for (; *sample < l->samples && sign * l->sample_t[*sample] <= end; ++*sample) {
    double *to = l->at_samples + *sample * l->columns * r->n, time = l->sample_t[*sample] - sign * begun;
    for (int64_t i = 0; i < (int64_t)l->columns * r->n; i++)
      to[i] = v ? value_at(v->of_states + i * r->stride, r->order, time) : l->y[i];
  }
}

/* Step of columns and state from an expansion; 0 where it is too short. */
static double taylor_step(Run *r, Leg *l, Slopes *g) {
  const Expansion *e = &r->e;
  const Variation *v = g->v;
  int64_t states = (int64_t)r->n * r->stride, series = (int64_t)r->width * r->stride;
  if (!e->finite) return 0;
  measure_slopes(r, e, g, 0);
  for (int k = 0; k < l->columns; k++) {
    begin_column(r, l, g, k);
    column_series(r, e, g, r->order);
    memcpy(v->of_states + k * states, v->states, sizeof(double) * states);
    memcpy(v->of_series + k * series, v->series, sizeof(double) * series);
  }
  double h = state_step(r, e);
  h = smaller(h, column_step(r, l, v, 0, l->starts)); /* those by the start, those by parameters */
  h = smaller(h, column_step(r, l, v, l->starts, l->columns - l->starts));
  if (!(h > (l->hit < 0 ? FIXED_SHORTEST * length_of_leg(l) : 0))) return 0;
  if (l->hit >= 0) return near_step(r, l->hit, smaller(h, length_of_leg(l)));
  return h >= l->left ? l->left : l->left < 1.5 * h ? smaller(h, 0.5 * l->left) : h;
}

/* Make a Taylor step; its length, or 0. */
static double make_taylor_step(Run *r, Leg *l, Slopes *g, double begun, int64_t *sample) {
  double h = taylor_step(r, l, g);
  if (!(h > 0)) return 0;
  record(r, l, way_of_leg(l) * h, begun, 0, r->x, r->unknowns);
  read_columns(r, l, g->v, begun, h, sample);
  move_columns(r, l, g->v, way_of_leg(l) * h);
  return h;
}

/* Make an implicit step, which ends at the next sample; its length, or 0. */
static double make_implicit_step(Run *r, Leg *l, Slopes *g, double begun, int64_t *sample) {
  double most = *sample < l->samples ? smaller(l->left, l->sample_t[*sample] - begun) : l->left;
  double h = solve_step(r, l, most);
  if (!(h > 0) || !move_implicit(r, l, g, h, begun)) return 0;
  read_columns(r, l, 0, begun, h, sample);
  return h;
}

/* Where derivatives by the start have grown apart, keep them and begin with others, which have all their digits. */
static void divide(const Run *r, Leg *l) {
  int64_t n = r->n, size = n * n;
  double *own = l->parts + l->part_count * (1 + size), *inverse = l->parts + l->part_room * (1 + size), forward = 0, back = 0;
  if (l->part_count >= l->part_room || !(l->left > 0)) return;
  memcpy(own + 1, l->y, sizeof(double) * size);
  if (!invert(own + 1, r->n, inverse)) return;
  for (int64_t i = 0; i < size; i++) { forward += l->y[i] * l->y[i]; back += inverse[i] * inverse[i]; }
  if (!(forward * back > l->ratio * l->ratio)) return;
  own[0] = length_of_leg(l) - l->left;
  memcpy(own + 1, l->y, sizeof(double) * size);
  memset(l->y, 0, sizeof(double) * size);
  for (int64_t i = 0; i < size; i += n + 1) l->y[i] = 1;
  l->part_count++;
}

static int carry(Run *r, Leg *l, Slopes *g) {
  double most = 0, size = 0;
  int64_t sample = 0;
  int order = r->order, is_implicit = 0;
  Expansion *e = &r->e;
  l->left = length_of_leg(l);
  l->step_count = 0;
  if (!begin_leg(r, l)) return LEG_NOT_UNIQUE;
  for (int64_t step = 0; step < l->most_steps; step++) {
    for (int i = 0; i < r->s->dimension; i++) size = larger(fabs(r->x[i]), size);
    r->o.atol = r->o.rtol * (size > 0 ? size : 1);
    r->size = size;
    r->time_size = length_of_leg(l);
    int at_end = l->hit < 0 && l->left <= 0 && !l->gradient; /* where the field is all that is needed */
    r->order = at_end || (is_implicit && l->left > 0) ? 1 : order;
    expand(r, r->letter, r->x, r->unknowns, e);
    r->order = order;
    if (step == 0 && land_state(r, g)) expand(r, r->letter, r->x, r->unknowns, e);
    for (int i = 0; i < r->s->dimension; i++)
      size = larger(fabs(e->states[(int64_t)i * r->stride + 1]) * length_of_leg(l), size);
    for (int i = 0; i < r->n; i++) l->end_rate[i] = e->states[(int64_t)i * r->stride + 1];
    if (!finite_all(l->end_rate, r->n)) return LEG_STUCK;
    if (step == 0) {
      memcpy(l->start_rate, l->end_rate, sizeof(double) * r->n);
      land(r, l, g);
    }
    if (l->hit < 0 ? l->left <= 0 : has_arrived(r, l->hit, &most)) {
      memcpy(l->end, r->x, sizeof(double) * r->n);
      if (r->s->timed) l->end[r->n - 1] += r->t;
      read_columns(r, l, 0, 0, INFINITY, &sample);
      return LEG_DONE;
    }
    double begun = length_of_leg(l) - l->left, h;
    if (is_implicit) {
      h = make_implicit_step(r, l, g, begun, &sample);
      is_implicit = h > 0;
    } else {
      h = make_taylor_step(r, l, g, begun, &sample);
      if (!(h > 0)) return LEG_STUCK;
      is_implicit = step % CHECK_AGAIN == CHECK_AGAIN - 1 && is_step_held(r, l, h);
    }
    l->left = h == l->left ? 0 : l->left - h;
    divide(r, l);
  }
  return LEG_STUCK;
}

/* Begin at the start of a leg; programs are prepared only for new parameters. */
static void begin_at(Run *r, const Leg *l) {
  int is_known = r->prepared && !r->s->timed && !memcmp(r->p, l->p, sizeof(double) * r->s->parameters);
  Options o = {.rtol = l->tol / SAFETY, .atol = l->tol};
  end_implicit(r);
  clear(r, &o, (Pair){r->s->timed ? l->x[r->n - 1] : 0, 0});
  if (!is_known) set_parameters(r, l->p);
  r->prepared = 1;
}

/* Integrate states and columns of legs with equal numbers of columns to their ends, and take gradients of events there. Their
 * steps are recorded consecutively in the room of the first. Returns the number of an unfinished leg, or -1. */
int64_t carry_legs(Run *r, Leg *l, int64_t count) {
  int64_t room = l->step_room, used = 0, failed = -1, part_room = l->part_room, parts = 0;
  double *begin = l->steps, *first_part = l->parts;
  Slopes g;
  Variation v;
  char *memory = calloc(place_variation(r, l->columns, &g, &v, 0), 1);
  if (!memory) { l->status = LEG_STUCK; return 0; }
  place_variation(r, l->columns, &g, &v, memory);
  for (int64_t i = 0; i < count && failed < 0; i++) {
    int64_t taken = used < room ? used : room;
    l[i].steps = room ? begin + taken * row_width(r) : 0;
    l[i].step_room = room - taken;
    l[i].parts = first_part + parts * (1 + (int64_t)r->n * r->n);
    l[i].part_room = part_room - parts;
    memset(v.h, 0, sizeof(double) * l->columns * r->m);
    begin_at(r, l + i);
    if (i == 0) begin_slopes(r, &g);
    l[i].status = carry(r, l + i, &g);
    if (l[i].status != LEG_DONE) failed = i;
    else if (l[i].gradient) event_gradient(r, l + i, &g);
    used += l[i].step_count;
    parts += l[i].part_count;
  }
  free(memory);
  return failed;
}

/* Pull a row back from the end of a leg with recorded steps to its start, with rows at the samples: LEG_DONE, or the
 * reason of failure. */
int32_t pull_row(Run *r, Leg *l) {
  int64_t sample = l->samples;
  Slopes g;
  Variation v;
  char *memory = calloc(place_variation(r, 0, &g, &v, 0), 1);
  if (!memory) return LEG_STUCK;
  place_variation(r, 0, &g, &v, memory);
  v.p = l->by_parameters;
  begin_at(r, l);
  begin_slopes(r, &g);
  int status = begin_leg(r, l) ? LEG_DONE : LEG_NOT_UNIQUE;
  for (int64_t s = l->step_count - 1; s >= 0 && status == LEG_DONE; s--) {
    const double *row = l->steps + s * row_width(r);
    if (row[2] < 0) continue; /* a stage */
    if (row[2] > 0) {
      if (!pull_implicit(r, l, &g, row, &sample)) status = LEG_STUCK;
      continue;
    }
    if (s == 0) begin_leg(r, l);
    for (int i = 0; i < r->m; i++) if (s && r->letter[i] == LEAVING) r->letter[i] = LEFT_BEHIND;
    memcpy(r->x, row + 3, sizeof(double) * r->n);
    memcpy(r->unknowns, row + 3 + r->n, sizeof(double) * r->width);
    lay_out(r, r->letter, &r->now);
    expand(r, r->letter, r->x, r->unknowns, &r->e);
    pull_step(r, l, &g, row[0], row[1], &sample);
    if (s == 0) pull_land(r, l, &g);
  }
  for (; sample > 0; sample--)
    for (int i = 0; i < r->n; i++) l->row[i] += l->at_samples[(sample - 1) * r->n + i];
  free(memory);
  return status;
}

/* Carry k orthonormal directions (k, n) by matrices (n, n) one after the other: ``q`` has the first ones and gets those
 * behind each matrix, ``growth`` the diagonals (k) of the triangular factors. */
void carry_frame(int64_t n, int64_t k, int64_t count, const double *matrix, double *q, double *growth) {
  for (; count > 0; count--, matrix += n * n, growth += k)
    for (int64_t j = 0; j < k; j++, q += n) {
      double *own = q + k * n;
      for (int64_t i = 0; i < n; i++) own[i] = dot(matrix + i * n, q, n);
      growth[j] = orthonormal(own, own - j * n, j, n, 2);
    }
}
