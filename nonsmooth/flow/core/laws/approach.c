/* Sets of codimension two and more in a run ----------------------------------------------------------------- */

/* Evaluate the law at a state with given multipliers of the functions ``own`` (or 0); list the other sliding functions as
 * r->pending and return their number. */
static int beside(Run *r, const int8_t *letter, const double *x, const double *unknowns, const int32_t *own, int k,
                  const double *lam) {
  int w = r->width, count = 0;
  aim(r, letter, x, unknowns);
  held_of(r, letter);
  for (int i = 0; i < w; i++) {
    int mine = -1;
    for (int j = 0; j < k; j++) if (own[j] == i) mine = j;
    if (mine >= 0) r->held[i] = lam ? lam[mine] : 0;
    else if (letter[i] == 0 && !is_idle(r, letter, i)) r->pending[count++] = i;
  }
  error_scales(r, x, r->held, r->none);
  return count;
}

/* Solve for the unknowns of the other sliding functions that cancel rates b, in place of b; 0 where there are none. */
static int balance(Run *r, int count, double *b) {
  double *d = r->work;
  for (int i = 0; i < count; i++)
    for (int j = 0; j < count; j++) d[i * count + j] = r->slope[r->pending[i] * r->width + r->pending[j]];
  return !count || solve_any(d, b, count, INFINITY, d + (int64_t)count * count, r->decision->pivot);
}

/* h' = a - M lambda of the functions ``own``, the other sliding functions eliminated; 0 where that is impossible. */
static int freeze(Run *r, const int8_t *letter, const double *x, const double *unknowns, const int32_t *own, int k,
                  double *a, double *m) {
  int w = r->width, count = beside(r, letter, x, unknowns, own, k, 0);
  const int32_t *others = r->pending;
  double *b = r->later;
  for (int i = 0; i < k; i++) {
    a[i] = layer_of(r, own[i]);
    for (int j = 0; j < k; j++) m[i * k + j] = -r->slope[own[i] * w + own[j]] * factor_of(r, own[j]);
  }
  for (int column = 0; count && column <= k; column++) {
    for (int i = 0; i < count; i++)
      b[i] = column == k ? layer_of(r, others[i]) : r->slope[others[i] * w + own[column]] * factor_of(r, own[column]);
    if (!balance(r, count, b)) return 0;
    for (int i = 0; i < k; i++) {
      double through = 0;
      for (int j = 0; j < count; j++) through += r->slope[own[i] * w + others[j]] * b[j];
      if (column == k) a[i] -= through; else m[i * k + column] += through;
    }
  }
  return finite_all(a, k) && finite_all(m, k * k);
}

/* The field with given multipliers of a set, and sliding multipliers of the other functions. */
static int field_with(Run *r, const int8_t *letter, const double *x, const double *unknowns, const int32_t *own, int k,
                      const double *lam, double *field) {
  int count = beside(r, letter, x, unknowns, own, k, lam);
  double *acting = r->later, *b = r->small;
  for (int i = 0; i < count; i++) b[i] = -layer_of(r, r->pending[i]);
  if (!balance(r, count, b)) return 0;
  memset(acting, 0, sizeof(double) * r->width);
  for (int i = 0; i < count; i++) acting[r->pending[i]] = b[i];
  field_of(r, x, r->held, acting, field);
  return 1;
}

/* The step along a straight line that is too short for a series. */
static void jump(Run *r, const double *rate, double dt) {
  int n = r->n, stride = r->stride;
  Expansion *e = &r->trial;
  for (int i = 0; i < n; i++) {
    double *c = e->states + (int64_t)i * stride;
    memset(c, 0, sizeof(double) * stride);
    c[0] = r->x[i]; c[1] = rate[i];
  }
  note_step(r, e);
  if (r->times) sample_step(r, e, dt);
  for (int i = 0; i < n; i++) r->x[i] += dt * rate[i];
  pass_time(r, dt);
  r->since += dt;
  r->step_count++;
  r->segment_steps++;
  memset(r->drop, 0, sizeof(int32_t) * r->guards);
  note(r);
}

/* Time to a point without a series below which coefficients of series overflow. */
static double shortest(const Run *r) { return pow(OVERFLOW, -1.0 / r->order); }

/* The shortest time in which a run comes close to such a point: shorter ones are rounding, or have no series. */
static double least_time(const Run *r) { return larger(shortest(r), TENFOLD * SHORTEST * time_scale(r)); }

/* Whether the state is on a set, or too close to it for a series; after surface_values. */
static int is_reached(Run *r, const int8_t *letter, int f, const double *h, const double *scales_of) {
  int k = size_of(r, f);
  int32_t own[3];
  double a[3], m[9], scale = scale_of_set(r, f, scales_of), radius = length_of(h + f, k), speed = 0;
  for (int i = 0; i < k; i++) own[i] = f + i;
  if (!(radius > 0) || radius <= VANISHES * scale || radius > CLOSE * scale) return !(radius > VANISHES * scale);
  if (!freeze(r, letter, r->x, r->unknowns, own, k, a, m)) return 0;
  for (int i = 0; i < k * k; i++) speed += m[i] * m[i];
  return radius < shortest(r) * (length_of(a, k) + sqrt(speed));
}

/* a of a set off its zero from its present rates, so that undetermined loads keep their present values. */
static void keep_loads(Run *r, const int32_t *own, int k, double *a, const double *m) {
  aim(r, r->letter, r->x, r->unknowns);
  error_scales(r, r->x, held_of(r, r->letter), r->unknowns);
  for (int i = 0; i < k; i++) {
    a[i] = layer_of(r, own[i]);
    for (int j = 0; j < k; j++) a[i] += m[i * k + j] * r->direction[own[j]];
  }
}

/* Treat a set whose |h| has fallen tenfold or is small: reach it, pass it, or repeat the test nearer. |h| below rounding is
 * zero, whatever its direction. */
static void near_set(Run *r, int row, int fell) {
  int f = r->now.index[row], k = size_of(r, f), n = r->n, before = r->mode;
  int32_t own[3];
  double h[3], a[3], m[9], u[3], b[3], mean[3], frozen[3], dt, c = 0;
  r->guard = (Guard){NEAR_GUARD, f, 0};
  if (r->letter[f] == 0) return; /* friction's limit has fallen: the next step resolves its digits */
  const double *height = surface_values(r, r->x), *scales_of = surface_scales(r, r->x);
  for (int i = 0; i < k; i++) {
    own[i] = f + i;
    h[i] = r->letter[f] == LEFT_BEHIND ? r->unknowns[f + i] : height[f + i];
  }
  double scale = scale_of_set(r, f, scales_of), radius = unit_of(h, k, u);
  if (!freeze(r, r->letter, r->x, r->unknowns, own, k, a, m)) { finish(r, NOT_FINITE, FIELD, 0); return; }
  memcpy(frozen, a, sizeof a);
  if (r->c && radius > 0) keep_loads(r, own, k, a, m);
  int at_floor = radius <= VANISHES * scale;
  int hits = is_vector_definite(m, k, VANISHES * k) && solve_vector(m, k, 0, a, b);
  hits = hits && length_of(b, k) < 1;
  for (int i = 0; i < k; i++) c += m[i * k + i] / k;
  int same = 1;
  double along = 0, square = 0, rate = 0;
  for (int i = 0; i < k; i++) {
    double g = a[i];
    for (int j = 0; j < k; j++) {
      same &= fabs(m[i * k + j] - (i == j ? c : 0)) <= SYMMETRIC * c;
      g -= m[i * k + j] * u[j];
    }
    rate += u[i] * g;
    along += a[i] * h[i];
    square += a[i] * a[i];
  }
  dt = hits && same ? (c * radius + along) / (c * c - square) : rate < 0 ? radius / -rate : INFINITY;
  at_floor |= dt < least_time(r);
  if (!hits && !at_floor) return;
  if (!(dt > 0 && dt < INFINITY)) {
    if (!(at_floor && (hits || fell))) return;
    dt = 0;
  }
  if (dt > 0) {
    double *field = r->at_work, *end = r->before, *other = r->aside, *turn = other + n, a2[3], m2[9], bend = 0;
    memcpy(mean, u, sizeof u);
    if (hits) {
      for (int i = 0; i < k; i++) b[i] = a[i] + h[i] / dt;
      solve_vector(m, k, 0, b, mean);
    }
    int good = field_with(r, r->letter, r->x, r->unknowns, own, k, mean, field);
    for (int i = 0; i < n; i++) end[i] = r->x[i] + dt * field[i];
    int is_known = good && freeze(r, r->letter, end, r->unknowns, own, k, a2, m2);
    if (!good || !(is_known || (at_floor && r->s->sets > 1))) { finish(r, NOT_FINITE, FIELD, 0); return; }
    for (int i = 0; is_known && i < k; i++) bend += fabs(a2[i] - frozen[i]); /* others may be zero there, without directions */
    for (int i = 0; is_known && i < k * k; i++) bend += fabs(m2[i] - m[i]);
    bend *= dt;
    if (!at_floor) {
      field_with(r, r->letter, r->x, r->unknowns, own, k, u, other);
      for (int i = 0; i < n; i++) turn[i] = fabs(field[i] - other[i]);
      field_with(r, r->letter, end, r->unknowns, own, k, mean, other);
      for (int i = 0; i < n; i++) {
        double allowed = i < r->s->dimension ? REACHED * SAFETY * (r->o.atol + r->o.rtol * fabs(r->x[i])) : 0;
        allowed += EPSILON * (r->size + fabs(r->x[i]));
        if ((turn[i] + fabs(field[i] - other[i])) * dt > allowed) return;
      }
      if (bend > REACHED * radius) return;
    }
    if (bend <= radius) jump(r, field, smaller(dt, r->o.t_end - r->t - r->t_low));
  }
  if (r->s->sets > 1 || r->c) { /* others may be zero there too; closed contacts stay so along a line */
    int held = kept_by(r, r->letter, r->involved);
    for (int i = 0; i < k; i++) r->involved[held++] = own[i];
    project(r, r->involved, held);
  }
  active_surfaces(r, f, r->letter);
  if (r->status != RUNNING) return;
  int kept = 0;
  for (int i = 0; i < r->active_count; i++) r->involved[kept++] = r->active[i];
  project(r, r->involved, kept);
  renote(r);
  memcpy(r->start, r->letter, r->width);
  if (choose(r, r->start, 0, 0) && r->mode != before) event(r, change_kind(r, before, r->mode), before, row, r->x);
}

/* Integrate h of sets that were left a step ago until it is far above rounding. */
static void after_step(Run *r) {
  int changed = 0, carried = 0;
  double *level = r->later;
  const double *scales_of = 0;
  EACH_SET(r, f) {
    int k = size_of(r, f), letter = r->letter[f];
    if (letter != LEAVING && letter != LEFT_BEHIND) continue;
    if (!scales_of) { surface_values(r, r->x); scales_of = surface_scales(r, r->x); }
    double least = LEFT * scale_of_set(r, f, scales_of);
    int next = letter == LEAVING || length_of(r->unknowns + f, k) <= least ? LEFT_BEHIND : OFF;
    for (int i = f; i < f + k; i++) {
      r->letter[i] = (int8_t)next;
      if (next == OFF) r->unknowns[i] = 0;
      else { r->involved[carried] = i; level[carried++] = r->unknowns[i]; }
    }
    changed |= next != letter;
  }
  if (carried) project_to(r, r->involved, carried, level);
  if (!changed) return;
  enter_mode(r);
  improve(r, &r->now, r->x, r->unknowns, 2); /* the direction is that of the state again */
}

/* Find nodes of a program that are zero for all states, from the values of the constant ones. */
static void find_zeros(const Values *t, const double *w, int8_t *zero) {
  memset(zero, 0, t->size);
  for (int32_t k = 0; k < t->still_count; k++) zero[t->still[k]] = w[t->still[k]] == 0;
  for (int32_t k = 0; k < t->moving_count; k++) {
    int32_t j = t->moving[k];
    int a = zero[t->a[j]], b = zero[t->b[j]];
    switch (t->op[j]) {
      case OP_input: zero[j] = 0; break;
      case OP_mul: case OP_if_else_zero: zero[j] = (int8_t)(a || b); break;
      case OP_add: case OP_sub: case OP_hypot: case OP_fmin: case OP_fmax: zero[j] = (int8_t)(a && b); break;
      case OP_assign: case OP_neg: case OP_twice: case OP_sq: case OP_sqrt: case OP_fabs: case OP_sign: case OP_sin:
      case OP_tan: case OP_asin: case OP_atan: case OP_sinh: case OP_tanh: case OP_div: zero[j] = (int8_t)a; break;
      default: zero[j] = 0;
    }
  }
}

/* Find sets whose multiplier does not enter the field with these parameters: no friction. */
static void find_idle(Run *r) {
  const Entries *column = &r->s->column;
  if (!r->s->sets) return;
  memset(r->idle, 1, r->m);
  find_zeros(&r->s->columns, r->columns, r->vanishes);
  for (int q = 0; q < column->count; q++) {
    int s = set_of(r, column->column[q]);
    if (s >= 0 && !r->vanishes[r->s->columns.output[q]]) r->idle[s] = 0;
  }
  find_zeros(&r->s->point, r->point, r->vanishes);
  EACH_SET(r, s) r->idle[s] |= r->vanishes[r->s->point.output[r->width + s]];
}

/* After a step without an event: find sets that are reached to rounding. */
static void check_sets(Run *r) {
  for (int row = 0; row < r->now.rows; row++) {
    int f = r->now.index[row], k = size_of(r, f);
    if (r->now.kind[row] != NEAR_GUARD || r->letter[f] < OFF || r->drop[row]) continue;
    const double *h = surface_values(r, r->x), *scales_of = surface_scales(r, r->x);
    double radius = length_of(r->letter[f] == LEFT_BEHIND ? r->unknowns + f : h + f, k);
    if (radius <= CLOSE * scale_of_set(r, f, scales_of)) { near_set(r, row, 0); return; }
  }
}
