/* Events that accumulate ---------------------------------------------------------------------------
 *
 * Impacts end in a closed contact, other events at their limit. The motion from the last event to the limit is
 * replaced by a simpler one only where they differ by less than the tolerance, and where nothing else happens.
 */

static const Happened *back(const Run *r, int64_t k) { return &r->past[(r->history - k) % HISTORY]; }

/* Number of the last events whose times decrease like a geometric series, as one block of a pattern that is
 * repeated, or 0; the time left to the limit, and how much the last block has changed the estimate. */
static int block_of(const Run *r, double *left, double *error) {
  int at_once = r->history > AT_ONCE;
  for (int k = 1; at_once && k <= AT_ONCE; k++) at_once = back(r, k)->interval == 0;
  *left = *error = 0;
  if (at_once) return AT_ONCE;
  for (int l = 0; l < LAG_COUNT; l++) {
    int lag = LAGS[l], need = BLOCKS * lag, same = 1;
    if (r->history < need + lag) return 0;
    for (int k = 1; k <= need && same; k++) same = back(r, k)->pattern == back(r, k + lag)->pattern;
    if (!same) continue;
    double block[BLOCKS], low = INFINITY, high = 0, ratio = 0, earlier = 0;
    for (int b = 0; b < BLOCKS; b++) {
      block[b] = 0;
      for (int k = 0; k < lag; k++) block[b] += back(r, need - b * lag - k)->interval;
    }
    for (int b = 1; b < BLOCKS; b++) {
      earlier = ratio;
      ratio = block[b] / block[b - 1]; /* not a number after an empty block */
      low = ratio > 0 ? fmin(low, ratio) : -INFINITY;
      high = fmax(high, ratio);
    }
    if (!(high < SHRINKS && high - low <= SPREAD * (1 - ratio))) continue;
    *left = block[BLOCKS - 1] * ratio / (1 - ratio);
    *error = fabs(block[BLOCKS - 2] * earlier / (1 - earlier) - block[BLOCKS - 1] - *left);
    return lag;
  }
  return 0;
}

/* Whether the run is read, or ends, within a time from now. */
static int is_awaited(const Run *r, double time) {
  int64_t low = 0, high = r->asked_count;
  while (low < high) {
    int64_t middle = (low + high) / 2;
    if (r->asked[middle] < r->t) low = middle + 1; else high = middle;
  }
  return r->o.t_end <= r->t + time || (low < r->asked_count && r->asked[low] <= r->t + time);
}

/* Whether one of the last events was that of a guard. */
static int is_repeated(const Run *r, int block, int kind, int index) {
  for (int k = 1; k <= block; k++) if (back(r, k)->met.kind == kind && back(r, k)->met.index == index) return 1;
  return 0;
}

/* Whether no guard of a mode has a root within a time, also if the states are off by ``near``. */
static int is_quiet(Run *r, Expansion *e, const int32_t *drop, const double *near, double time, int block) {
  double *noise = r->work;
  int order = r->order;
  if (!e->finite || is_awaited(r, time) || step_size(r, e) < time) return 0;
  weigh_again(r, e);
  guard_sums(r, e, near, 1, noise);
  for (int row = 0; row < e->l.rows; row++) {
    const double *c = e->guards + (int64_t)row * r->stride + drop[row];
    if (drop[row] > order || is_repeated(r, block, e->l.kind[row], e->l.index[row])) continue;
    if (!(fabs(c[0]) - (drop[row] ? 0 : noise[row]) > rest_of(c, order - drop[row], time))) return 0;
  }
  return 1;
}

/* Contacts that impacts have brought together: those of the last block, to the tolerance; the largest speed
 * among them. */
static int gathered(Run *r, int block, int32_t *which, double *speed) {
  const double *gap = gaps(r, r->x), *rate = gap + r->c;
  int count = 0;
  *speed = 0;
  for (int j = 0; j < r->c; j++)
    if (gap[j] == 0 || (is_repeated(r, block, IMPACT_GUARD, j) && gap[j] <= r->o.atol)) {
      which[count++] = j;
      *speed = larger(fabs(rate[j]), *speed);
    }
  return count;
}

/* The mode of closed contacts as r->chosen, and the state in it as r->x; 0 if there is none. */
static int choose_closed(Run *r, const int32_t *contact, int count) {
  int kept = 0, m = r->m, c = r->c;
  int32_t *which = r->involved + c;
  if (!strike(r, contact, count, 1, r->at_work)) return 0;
  memcpy(r->x, r->at_work, sizeof(double) * r->n);
  for (int i = 0; i < count; i++) which[kept++] = m + contact[i];
  for (int i = 0; i < count; i++) which[kept++] = m + c + contact[i];
  project(r, which, kept);
  letters_of(r, r->start);
  active_surfaces(r, -1, r->start);
  for (int i = 0; i < count; i++) { /* those that rest are so, whatever rounding says */
    int at = 0;
    while (at < r->active_count && r->active[at] < which[i]) at++;
    if (at < r->active_count && r->active[at] == which[i]) continue;
    memmove(r->active + at + 1, r->active + at, sizeof(int32_t) * (r->active_count - at));
    r->active[at] = which[i];
    r->active_count++;
  }
  return r->status == RUNNING && decide(r, r->start, 0, 0);
}

/* Whether a time is below the rounding of the run's times. */
static int is_instant(const Run *r, double time) {
  return time <= SHORTEST * time_scale(r);
}

/* Close the contacts of impacts that accumulate, unless further impacts are to be served. */
static void close_contacts(Run *r, int block, double left, double error) {
  double speed, *near = r->before, *x = r->saved;
  int count = gathered(r, block, r->involved, &speed), before = r->mode, at_once = is_instant(r, left);
  if (!at_once && speed * left > r->o.atol) return;
  memcpy(x, r->x, sizeof(double) * r->n);
  if (!choose_closed(r, r->involved, count)) {
    if (r->status == RUNNING) { r->limit = r->t + left; finish(r, ACCUMULATION, NO_REASON, 0); }
    return;
  }
  expand(r, r->chosen.letter, r->x, r->chosen.unknowns, &r->e);
  for (int i = 0; i < r->n; i++) near[i] = 2 * fabs(x[i] - r->x[i]);
  if (!at_once && !is_quiet(r, &r->e, r->chosen.drop, near, left + error, 0)) {
    memcpy(r->x, x, sizeof(double) * r->n);
    return;
  }
  adopt(r, &r->chosen);
  note(r);
  r->history = 0;
  int closed = 0;
  for (int i = r->m; i < r->width; i++) closed |= r->letter[i] == 0;
  left = smaller(left, r->o.t_end - r->t - r->t_low);
  if (closed && r->e.finite && advance(r, &r->e, left)) {
    r->limit = r->t;
    event(r, change_kind(r, before, r->mode), before, -1, r->x);
  }
}

/* End a run whose events accumulate, unless further ones are to be served. */
static void end_at_limit(Run *r, int block, double left, double error) {
  double *near = r->before, time = left + error;
  expand(r, r->letter, r->x, r->unknowns, &r->e);
  if (!is_instant(r, left)) {
    for (int i = 0; i < r->s->dimension; i++) {
      near[i] = time * fabs(r->e.states[(int64_t)i * r->stride + 1]);
      if (!(near[i] <= larger(r->e.allowed[i], VANISHES * (r->size + fabs(r->x[i]))))) return;
    }
    if (r->s->timed) near[r->n - 1] = time;
    if (!is_quiet(r, &r->e, r->drop, near, time, block)) return;
  }
  r->limit = r->t + left;
  finish(r, ACCUMULATION, NO_REASON, 0);
}

/* Keep an event in mind, and see whether the last ones accumulate. */
static void watch_accumulation(Run *r, int kind, int before, int guard) {
  double left, error;
  int64_t pattern = (((int64_t)kind * 4096 + guard + 1) << 40) + ((int64_t)before << 20) + r->mode;
  r->past[r->history++ % HISTORY] = (Happened){r->since, pattern, kind, r->met};
  r->since = 0;
  int block = block_of(r, &left, &error), only_impacts = r->c > 0;
  if (!block || r->status != RUNNING) return;
  for (int k = 1; k <= block; k++) only_impacts &= back(r, k)->kind == IMPACT;
  if (only_impacts) close_contacts(r, block, left, error); else end_at_limit(r, block, left, error);
}
