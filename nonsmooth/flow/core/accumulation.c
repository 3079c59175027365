/* Events that accumulate ---------------------------------------------------------------------------
 *
 * Impacts end in a closed contact, other events at their limit. The motion from the last event to the limit is
 * replaced by a simpler one only where they differ by less than the tolerance, and where nothing else happens.
 */

static const Happened *back(const Run *r, int64_t k) { return &r->past[(r->history - k) % HISTORY]; }

/* Length of a repeated block of events whose intervals decrease like a geometric series, or 0; the time left to the limit,
 * and its error. The ratio converges at least as fast as the intervals: its changes from block to block are summed too
 * (Aitken). */
static int block_of(const Run *r, double *left, double *error) {
  int at_once = r->history > AT_ONCE;
  for (int k = 1; at_once && k <= AT_ONCE; k++) at_once = back(r, k)->interval == 0 && back(r, k)->kind != RESET;
  *left = *error = 0;
  if (at_once) return AT_ONCE;
  for (int l = 0; l < LAG_COUNT; l++) {
    int lag = LAGS[l], need = BLOCKS * lag, same = 1;
    double block[BLOCKS], ratio = 0, change = 0, before = 0;
    if (r->history < need + lag) return 0;
    for (int b = 0; b < BLOCKS && same; b++) { /* most events do not accumulate, as the last blocks show */
      block[b] = 0;
      for (int k = 1; k <= lag; k++) block[b] += back(r, b * lag + k)->interval;
      same = b == 0 || block[b - 1] < SHRINKS * block[b];
    }
    for (int k = 1; k <= need && same; k++) same = back(r, k)->pattern == back(r, k + lag)->pattern;
    if (!same || !shrink_alike(block)) continue;
    for (int b = BLOCKS - 2; b >= 0; b--) {
      before = change;
      change = block[b] - *left;
      ratio = block[b] / block[b + 1];
      *left = block[b] * ratio / (1 - ratio);
      change += *left;
    }
    *error = fabs(change);
    if (!(*error < ratio * fabs(before))) return lag;
    double rest = change * change / (before - change);
    *error *= larger(*error, fabs(rest)) / *left;
    *left += rest;
    if (*left > 0) return lag; /* else the changes do not vanish with the blocks */
  }
  return 0;
}

/* Whether the run is sampled, or ends, within a time from now. */
static int is_awaited(const Run *r, double time) {
  int64_t low = 0, high = r->read_count;
  while (low < high) {
    int64_t middle = (low + high) / 2;
    if (r->read_at[middle] < r->t) low = middle + 1; else high = middle;
  }
  return r->o.t_end <= r->t + time || (low < r->read_count && r->read_at[low] <= r->t + time);
}

/* Whether one of the last events was that of a guard. */
static int is_repeated(const Run *r, int block, int kind, int index) {
  for (int k = 1; k <= block; k++) if (back(r, k)->guard.kind == kind && back(r, k)->guard.index == index) return 1;
  return 0;
}

/* Whether one of the last events is of a kind. */
static int has_kind(const Run *r, int block, int kind) {
  for (int k = 1; k <= block; k++) if (back(r, k)->kind == kind) return 1;
  return 0;
}

/* Guards of the last events end no step: they may have no series at the limit. */
static void forget_repeated(const Run *r, Expansion *e, int block) {
  for (int row = 0; row < e->l.rows; row++)
    if (is_repeated(r, block, e->l.kind[row], e->l.index[row]))
      memset(e->guards + (int64_t)row * r->stride, 0, sizeof(double) * r->stride);
}

/* Whether no guard of a mode has a root within a time, for states with errors up to ``near``. */
static int is_quiet(Run *r, Expansion *e, const int32_t *drop, const double *near, double time, int block) {
  double *noise = r->work;
  int order = r->order;
  int singular = !e->finite && r->has_roots; /* on a surface where a root has no series */
  forget_repeated(r, e, block);
  if (is_awaited(r, time) || (!singular && (!e->finite || step_size(r, e) < time))) return 0;
  weigh_again(r, e);
  guard_sums(r, e, near, 1, noise);
  for (int row = 0; row < e->l.rows; row++) {
    const double *c = e->guards + (int64_t)row * r->stride + drop[row];
    if (is_atom(e->l.kind[row]) && (!r->instant.side[row - e->l.atoms] || e->l.side[row] == UNWATCHED)) continue;
    if (drop[row] > order || is_repeated(r, block, e->l.kind[row], e->l.index[row])) continue;
    int may_vanish = e->l.kind[row] == SURFACE_GUARD && (block || has_law(r, e->l.index[row], TABLE_LAW));
    if (may_vanish && fabs(c[0]) <= noise[row]) continue; /* is zero at the limit */
    if (singular && !(fabs(c[0]) <= noise[row])) continue;
    if (!(fabs(c[0]) - (drop[row] ? 0 : noise[row]) > rest_of(c, order - drop[row], time))) return 0;
  }
  return 1;
}

/* Contacts of the last block that impacts have closed to the tolerance; their largest speed. */
static int gathered(Run *r, int block, int32_t *which, double *speed) {
  const double *gap = gaps(r, r->x), *rate = gap + r->c;
  int count = 0;
  *speed = 0;
  for (int j = 0; j < r->c; j++)
    if (gap[j] == 0 || (is_repeated(r, block, IMPACT_GUARD, r->m + j) && gap[j] <= r->o.atol)) {
      which[count++] = j;
      *speed = larger(fabs(rate[j]), *speed);
    }
  return count;
}

/* Choose the motion at a point where some elements come to rest up to rounding, as r->chosen; 0 if there is none. */
static int decide_among(Run *r, const int32_t *which, int count) {
  letters_of(r, r->start);
  active_surfaces(r, -1, r->start);
  for (int i = 0; i < count; i++) {
    int at = 0;
    while (at < r->active_count && r->active[at] < which[i]) at++;
    if (at < r->active_count && r->active[at] == which[i]) continue;
    memmove(r->active + at + 1, r->active + at, sizeof(int32_t) * (r->active_count - at));
    r->active[at] = which[i];
    r->active_count++;
  }
  return r->status == RUNNING && decide(r, r->start, 0, 0) && rests_unstably(r, r->chosen.letter) < 0;
}

/* Project the state onto the zeros of some elements. */
static void put_at_rest(Run *r, const int32_t *element, int count) {
  int32_t *which = r->involved + r->width;
  int kept = count;
  memmove(which, element, sizeof(int32_t) * count);
  for (int i = 0; i < count; i++) kept += lower_rows(r, element[i], which + kept);
  project(r, which, with_joints(r, which, kept));
}

/* Choose the mode of closed contacts, and of surfaces whose events accumulate with theirs, as r->chosen, with its state as
 * r->x; 0 if there is none. */
static int choose_closed(Run *r, const int32_t *contact, int count, const int32_t *surface, int surfaces) {
  int32_t *which = r->involved + r->width;
  if (!strike(r, contact, count, 1, r->at_work)) return 0;
  memcpy(r->x, r->at_work, sizeof(double) * r->n);
  for (int i = 0; i < count; i++) which[i] = r->m + contact[i];
  memcpy(which + count, surface, sizeof(int32_t) * surfaces);
  put_at_rest(r, which, count + surfaces);
  return decide_among(r, which, count + surfaces);
}

/* Whether a time is below the rounding of the run's times. */
static int is_instant(const Run *r, double time) {
  return time <= SHORTEST * time_scale(r);
}

/* Move to the limit, in the mode that is admissible there. */
static void go_to_limit(Run *r, double left, int kind, int before) {
  r->history = 0;
  if (!advance(r, &r->e, smaller(left, r->o.t_end - r->t - r->t_low))) return;
  r->limit = r->t;
  event(r, kind, before, -1, r->x);
}

/* Whether no state moves by more than the tolerance within the error of a limit. */
static int is_sure(Run *r, double error) {
  expand(r, r->letter, r->x, r->unknowns, &r->e);
  for (int i = 0; i < r->s->dimension; i++)
    if (error * fabs(r->e.states[(int64_t)i * r->stride + 1]) > r->e.allowed[i] / SAFETY) return 0;
  return 1;
}

/* Surfaces that are zero at a limit, with their lower derivatives, if the states change by ``near`` until then. */
static int vanishing(Run *r, const double *near, int32_t *which) {
  double *change = r->small, *own = r->vector;
  int count = 0;
  surface_values(r, r->x);
  for (int i = 0; i < r->n; i++) own[i] = 4 * near[i] + ON_SURFACE * (size_of_state(r, i) + fabs(r->x[i])); /* rates may jump */
  kept_sums(r, own, change);
  for (int i = 0; i < r->m; i++) {
    int small = has_law(r, i, SURFACE_LAW) && fabs(r->rates[i]) <= change[i], first = element(r, i)->lower;
    for (int k = first; k < first + degree_of(r, i) - 1; k++) small &= fabs(r->rates[k]) <= change[k];
    if (small) which[count++] = i;
  }
  return count;
}

/* Close the contacts of impacts that accumulate, unless further impacts must be processed. */
static void close_contacts(Run *r, int block, double left, double error) {
  double speed, *near = r->before, *x = r->saved;
  int count = gathered(r, block, r->involved, &speed), before = r->mode, at_once = is_instant(r, left), switches = 0, open = 0;
  for (int k = 1; k <= block; k++) switches |= back(r, k)->kind != IMPACT;
  for (int i = 0; i < count; i++) open |= r->letter[r->m + r->involved[i]] != 0;
  if (!open) return; /* the last impact has closed them */
  if (!at_once && (speed * left > r->o.atol || !is_sure(r, error))) return;
  int32_t *surface = r->involved + r->c;
  for (int i = 0; i < r->n; i++) near[i] = (left + error) * fabs(r->e.states[(int64_t)i * r->stride + 1]);
  int surfaces = at_once || !switches ? 0 : vanishing(r, near, surface);
  memcpy(x, r->x, sizeof(double) * r->n);
  if (!choose_closed(r, r->involved, count, surface, surfaces)) {
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
  int closed = 0;
  for (int i = r->m; i < r->width; i++) closed |= r->letter[i] == 0;
  if (closed && r->e.finite) go_to_limit(r, left, change_kind(r, before, r->mode), before);
}

/* Project the state onto some surfaces, as r->x, and choose the motion there as r->chosen; 0 with the old state where there
 * is none, or where the projection moves it by more than ``near``. */
static int choose_rest(Run *r, const int32_t *element, int count, const double *near) {
  double *x = r->saved;
  int close = 1, status = r->status;
  memcpy(x, r->x, sizeof(double) * r->n);
  put_at_rest(r, element, count);
  for (int i = 0; near && i < r->n; i++)
    close &= fabs(r->x[i] - x[i]) <= 4 * near[i] + VANISHES * (r->size + fabs(x[i]));
  if (close && decide_among(r, element, count)) {
    int rests = 0;
    for (int i = 0; i < count; i++) rests |= r->chosen.letter[element[i]] == 0;
    if (rests) return 1;
  }
  r->status = status;
  memcpy(r->x, x, sizeof(double) * r->n);
  return 0;
}

/* Whether a motion leaves the zero of a stop or reset among the last events. */
static int leaves_jumps(Run *r, Expansion *e, int block) {
  double value = 0;
  for (int row = 0; row < e->l.rows && value == 0; row++)
    if (is_atom(e->l.kind[row]) && is_repeated(r, block, e->l.kind[row], e->l.index[row])) leading(r, e, row, 1, &value);
  return value != 0;
}

/* Add the jumps of all resets up to the limit, as a geometric series, to states that do not come to rest. */
static void add_jumps(Run *r, int block) {
  for (int i = 0; r->s->resets && r->history > 2 * block && i < r->s->dimension; i++) {
    double last = 0, before = 0;
    for (int k = 1; k <= 2 * block; k++) *(k > block ? &before : &last) += r->jumped[(r->history - k) % HISTORY * r->n + i];
    double ratio = last / before;
    if (last != 0 && fabs(ratio) < SHRINKS && r->x[i] == r->saved[i]) r->x[i] += last * ratio / (1 - ratio);
  }
}

/* Come to rest where crossings and resets accumulate; 0 where no motion continues. */
static int come_to_rest(Run *r, double left, const double *near, int block) {
  int before = r->mode, count = vanishing(r, near, r->involved);
  if (!count || !choose_rest(r, r->involved, count, near)) return 0;
  add_jumps(r, block);
  expand(r, r->chosen.letter, r->x, r->chosen.unknowns, &r->e);
  if (leaves_jumps(r, &r->e, block)) {
    memcpy(r->x, r->saved, sizeof(double) * r->n);
    return 0;
  }
  adopt(r, &r->chosen);
  note(r);
  if (r->e.finite) go_to_limit(r, left, REST, before);
  return 1;
}

/* Go to the limit of accumulating events where rounding made rest begin slightly before it; 0 where the event is no such
 * one. */
static int rest_at_limit(Run *r, int before) {
  const int8_t *letter = r->table->letter + (int64_t)before * r->table->width;
  double left, error, *near = r->before;
  int rests = 0, block = block_of(r, &left, &error);
  for (int i = 0; i < r->m; i++) rests |= r->letter[i] == 0 && letter[i] != 0 && degree_of(r, i) > 1;
  left -= r->since;
  if (!block || !rests || left < 0) return 0;
  memset(near, 0, sizeof(double) * r->n);
  expand(r, r->letter, r->x, r->unknowns, &r->e);
  if (!is_quiet(r, &r->e, r->drop, near, left + error, 0)) return 0;
  go_to_limit(r, left, REST, before);
  return 1;
}

/* Whether the guards of events that repeat stay at zero, to rounding, until the limit: further events are noise. */
static int is_lost(Run *r, double time, int block) {
  int repeated = 0;
  for (int row = 0; row < r->now.rows; row++) {
    const double *c = r->e.guards + (int64_t)row * r->stride;
    int atom = row - r->now.atoms;
    if (!is_atom(r->now.kind[row]) || !is_repeated(r, block, r->now.kind[row], r->now.index[row])) continue;
    repeated = 1;
    if (!(fabs(c[0]) + rest_of(c, r->order, time) <= FAR_FROM_LOW * VANISHES * r->instant.noise[atom])) return 0;
  }
  return repeated && r->e.finite;
}

/* Go to the limit of events that accumulate, where the motion rests or the run ends, unless further events must be
 * processed. */
static void end_at_limit(Run *r, int block, double left, double error) {
  double *near = r->before, time = left + error;
  int at_once = is_instant(r, left), is_short = r->has_roots && is_instant(r, ROOT_REST * time);
  expand(r, r->letter, r->x, r->unknowns, &r->e);
  is_short |= is_lost(r, time, block);
  for (int i = 0; i < r->n; i++) {
    near[i] = time * fabs(r->e.states[(int64_t)i * r->stride + 1]);
    double small = larger(r->e.allowed[i], VANISHES * (r->size + fabs(r->x[i])));
    if (!at_once && !is_short && i < r->s->dimension && !(near[i] <= small)) return;
  }
  if (!at_once && !is_quiet(r, &r->e, r->drop, near, time, block)) return;
  if (come_to_rest(r, left, near, block)) return;
  r->limit = r->t + left;
  finish(r, ACCUMULATION, NO_REASON, 0);
}

/* Rest on a surface of relative degree two whose speeds at two consecutive zeros decrease and are below ``rest_below``. */
static void rest_if_slow(Run *r) {
  int before = r->mode;
  for (int i = 0; i < r->m && r->status == RUNNING; i++) {
    int32_t one = i;
    double speed, *last = r->speed + i;
    surface_values(r, r->x);
    if (degree_of(r, i) != 2 || r->letter[i] == 0) continue;
    if (!(fabs(r->rates[i]) <= VANISHES * surface_scales(r, r->x)[i])) continue;
    speed = fabs(r->rates[element(r, i)->lower]);
    int slow = speed < r->o.rest_below && *last < r->o.rest_below && speed < (1 - VANISHES) * *last;
    *last = speed;
    if (!slow || !choose_rest(r, &one, 1, 0)) continue;
    adopt(r, &r->chosen);
    note(r);
    r->history = 0;
    event(r, REST_BELOW, before, -1, r->x);
    return;
  }
}

/* Store an event among the last ones. */
static void remember(Run *r, int kind, int guard, const double *x) {
  int64_t pattern = ((int64_t)kind << 40) + ((int64_t)r->guard.kind << 32) + (guard < 0 ? -1 : shown_index(r));
  double *jumped = r->jumped + (r->s->resets ? r->history % HISTORY * r->n : 0);
  for (int i = 0; r->s->resets && i < r->n; i++) jumped[i] = kind == RESET ? r->x[i] - x[i] : 0;
  r->past[r->history++ % HISTORY] = (Happened){r->since, pattern, kind, r->guard};
  r->since = 0;
}

/* Find whether the last events accumulate. */
static void see_limit(Run *r) {
  double left, error;
  int block;
  if (r->o.rest_below > 0 && r->status == RUNNING) rest_if_slow(r);
  block = block_of(r, &left, &error);
  if (!block || r->status != RUNNING) return;
  if (has_kind(r, block, IMPACT) && !has_kind(r, block, RESET)) close_contacts(r, block, left, error); else end_at_limit(r, block, left, error);
}

/* Whether events accumulate at a point where no series exists: a surface with a root rests there, else the run ends. */
static int ends_at_singular(Run *r) {
  double left, error, *near = r->before;
  int block = block_of(r, &left, &error);
  if (!block) return 0;
  left = larger(left - r->since, 0);
  for (int i = 0; i < r->n; i++) near[i] = left * fabs(r->e.states[(int64_t)i * r->stride + 1]);
  r->e.finite = 0; /* the first terms alone say how far guards are */
  if (r->has_roots && is_quiet(r, &r->e, r->drop, near, left, block) && come_to_rest(r, left, near, block)) return 1;
  r->limit = r->t + left;
  finish(r, ACCUMULATION, NO_REASON, 0);
  return 1;
}
