/* Filippov's logic: nonsmooth/flow/reference/switching.py ---------------------------------------------- */

/* Both fields tangent to a surface at the present point, and the sliding field 0/0. */
static int is_two_fold(Run *r, const int8_t *letter, int surface, double tolerance) {
  if (r->s->continuous[surface]) return 0;
  double *near = r->vector + r->n + r->width; /* not where inputs are put together */
  aim(r, letter, r->x, r->unknowns);
  for (int i = 0; i < r->n; i++) near[i] = r->size + fabs(r->x[i]);
  for (int side = 1; side >= -1; side -= 2) {
    held_of(r, letter);
    r->held[surface] = side;
    error_scales(r, r->x, r->held, r->none);
    if (r->s->scaled[surface] && r->slope[surface * r->width + surface] != 0) return 0;
    gradient_sums(r, &r->s->point, r->point, 2 * r->width + r->s->slope.count, &r->s->layer_gradient, r->width, near,
                  1, r->small);
    double scale = r->small[surface];
    if (!(fabs(layer_of(r, surface)) <= (tolerance + TANGENT) * scale)) return 0; /* or zero everywhere */
  }
  return 1;
}

/* Rates of the active surfaces as a + M lambda (reactions open contacts), and their rounding; 0 where they
 * do not decide. a, M, scales one after the other in r->matrix. */
static int rates(Run *r, const int8_t *letter) {
  int k = r->active_count, w = r->width;
  double *a = r->matrix, *m = a + k, *scale = m + (int64_t)k * k, *near = r->vector + r->n + w;
  if (!r->s->affine) return 0;
  aim(r, letter, r->x, r->unknowns);
  held_of(r, letter);
  for (int i = 0; i < k; i++) {
    int own = r->active[i];
    r->held[own] = 0;
    if (own >= r->m) continue;
    if (r->s->continuous[own]) return 0;
    for (int j = 0; j < k; j++)
      if (r->active[j] >= r->m && r->s->carries[own * r->c + r->active[j] - r->m]) return 0;
  }
  error_scales(r, r->x, r->held, r->none);
  for (int i = 0; i < r->n; i++) near[i] = r->size + fabs(r->x[i]);
  gradient_sums(r, &r->s->point, r->point, 2 * w + r->s->slope.count, &r->s->layer_gradient, w, near, 1, r->small);
  for (int i = 0; i < w; i++) if (!(fabs(layer_of(r, i)) < INFINITY)) return 0;
  for (int i = 0; i < k; i++) {
    double turn = r->active[i] < r->m ? 1 : -1;
    if (factor_of(r, r->active[i]) == 0) return 0;
    a[i] = turn * layer_of(r, r->active[i]);
    scale[i] = r->small[r->active[i]];
    for (int j = 0; j < k; j++)
      m[i * k + j] = turn * r->slope[r->active[i] * w + r->active[j]] * factor_of(r, r->active[j]);
  }
  return 1;
}

/* Of a guard that ended the mode before so many coefficients vanish. */
typedef struct { int kind, index, side, zeros; } Known;

/* What is being left has a multiplier at its bound, to the tolerance of the run: its rates decide nothing. */
static int is_left(const Run *r, int which, const Known *known, int count) {
  for (int i = 0; i < count; i++)
    if (known[i].index + (known[i].kind == IMPACT_GUARD || known[i].kind == RELEASE_GUARD ? r->m : 0) == which) return 1;
  return 0;
}

static void many_may_hold(Run *r) { finish(r, NON_UNIQUE, POSSIBLY_SEVERAL, 0); }

static int bits(int a) { return (a & 1) + (a >> 1 & 1) + (a >> 2 & 1); }

/* Number of the modes that are possible, or one more than are tried. */
static int choices_of(const int8_t *possible, int count) {
  int total = 1;
  for (int i = 0; i < count && total <= TRIED; i++) total *= bits(possible[i]);
  return total <= TRIED ? total : TRIED + 1;
}

/* Letters that are possible at the active surfaces, as bits of +1 (1), -1 (2) and sliding (4), for contacts
 * open (1) and closed (4): one where the rates decide, else all. 0 if the run ends. */
static int by_rates(Run *r, const int8_t *letter, const Known *known, int known_count, int8_t *possible) {
  int k = r->active_count, contacts = 0;
  for (int i = 0; i < k; i++) {
    contacts |= r->active[i] >= r->m;
    possible[i] = r->active[i] < r->m ? 7 : 5;
  }
  if (k < 2) return 1;
  int choices = choices_of(possible, k);
  if (!rates(r, letter)) {
    if (choices > TRIED) many_may_hold(r);
    return choices <= TRIED;
  }
  double *a = r->matrix, *m = a + k, *scale = m + (int64_t)k * k;
  if (!shown(m, k, r->work, r->pending)) {
    if (choices > TRIED || (k > FEW && !contacts)) { finish(r, HAND_OVER, NO_REASON, 0); return 0; }
    return 1;
  }
  int8_t *contact = (int8_t *)(scale + k), *guess = contact + k;
  for (int i = 0; i < k; i++) {
    contact[i] = r->active[i] >= r->m;
    guess[i] = contact[i] ? -letter[r->active[i]] : letter[r->active[i]];
  }
  if (!complementarity(a, m, k, contact, guess, r->lam, r->work, r->pending)) {
    finish(r, INTERSECTION, NO_STABLE_MOTION, 0);
    return 0;
  }
  for (int i = 0; i < k; i++) {
    double rate = a[i], sum = 0, lam = r->lam[i];
    for (int j = 0; j < k; j++)
      if (m[i * k + j] != 0) { rate += m[i * k + j] * r->lam[j]; sum += fabs(m[i * k + j]); }
    double room = contact[i] ? lam : 1 - fabs(lam);
    if (is_left(r, r->active[i], known, known_count)) continue;
    if (room > VANISHES * (1 + scale[i] / fabs(m[i * k + i]))) possible[i] = 4;
    else if (fabs(rate) > VANISHES * (scale[i] + sum)) possible[i] = contact[i] || lam > 0 ? 1 : 2;
  }
  choices = choices_of(possible, k);
  if (choices > TRIED) many_may_hold(r);
  return choices <= TRIED;
}

/* Whether sliding is stable across its layer: 1, 0, or -1 where no simple test shows it. */
static int is_stable(Run *r, const Layout *l) {
  int k = 0, w = r->width;
  for (int i = 0; i < l->slides; i++) k += l->sliding[i] < r->m;
  if (k == 0) return 1;
  double *a = r->matrix;
  int row = 0;
  for (int i = 0; i < l->slides; i++) {
    int column = 0;
    if (l->sliding[i] >= r->m) continue;
    double turn = ns_sign(factor_of(r, l->sliding[i]));
    for (int j = 0; j < l->slides; j++) {
      if (l->sliding[j] >= r->m) continue;
      a[row * k + column++] = turn * r->slope[l->sliding[i] * w + l->sliding[j]];
    }
    row++;
  }
  if (k == 1) return a[0] < 0;
  if (k == 2) return a[0] + a[3] < 0 && a[0] * a[3] - a[1] * a[2] > 0;
  return shown(a, k, r->work, r->pending) == 2 ? 1 : -1;
}

/* Coefficients that are no numbers decide nothing. */
static void keep_finite(Run *r, Expansion *e) {
  for (int i = 0; i < r->n * r->stride; i++) if (!(fabs(e->states[i]) < INFINITY)) e->states[i] = 0;
  for (int i = 0; i < e->l.rows * r->stride; i++) if (!(fabs(e->guards[i]) < INFINITY)) e->guards[i] = 0;
}

/* Whether the motion can continue in a mode with given unknowns: its guards that vanish here become positive. */
static int continues(Run *r, const int8_t *letter, const Known *known, int known_count, Continuation *result) {
  Expansion *e = &r->trial;
  lay_out(r, letter, &e->l);
  if (e->l.slides) {
    error_scales(r, r->x, held_of(r, letter), result->unknowns);
    int stable = is_stable(r, &e->l);
    if (stable < 0) { finish(r, HAND_OVER, NO_REASON, 0); return 0; }
    if (!stable) return 0;
  }
  expand(r, letter, r->x, result->unknowns, e);
  if (!e->finite) keep_finite(r, e);
  memcpy(result->letter, letter, r->width);
  result->strict = 1;
  memset(result->drop, 0, sizeof(int32_t) * r->guards);
  for (int row = 0; row < e->l.rows; row++) {
    int kind = e->l.kind[row], index = e->l.index[row], of = index, active = 0, zeros = 0;
    if (kind == STOP_GUARD || kind == RESET_GUARD) continue;
    if (kind == NEAR_GUARD && letter[index] == 0) continue; /* ends steps only */
    if (kind == IMPACT_GUARD || kind == RELEASE_GUARD) of += r->m;
    for (int i = 0; i < r->active_count; i++) active |= r->active[i] == of;
    if (!active) continue;
    for (int i = 0; i < known_count; i++)
      if (known[i].kind == kind && known[i].index == index && known[i].side == e->l.side[row]) zeros = known[i].zeros;
    if ((kind == SURFACE_GUARD || kind == NEAR_GUARD) && zeros < 1) zeros = 1;
    if (kind == IMPACT_GUARD && zeros < 2) zeros = 2;
    double value;
    int k = leading(r, e, row, zeros, &value);
    if (value < 0) return 0;
    if (value == 0) result->strict = 0;
    result->drop[row] = value != 0 ? (k < r->order ? k : r->order) : r->order + 1;
  }
  return 1;
}

/* The same with the unknowns that keep what slides in the mode; those of sets are given. */
static int continuation(Run *r, const int8_t *letter, const Known *known, int known_count, Continuation *result) {
  lay_out(r, letter, &r->trial.l);
  if (!meets_sets(r)) keep_carried(r, letter, result->unknowns);
  if (r->trial.l.slides && !improve(r, &r->trial.l, r->x, result->unknowns, 1)) return 0;
  return continues(r, letter, known, known_count, result);
}

static void copy_continuation(const Run *r, Continuation *to, const Continuation *from) {
  memcpy(to->letter, from->letter, r->width);
  memcpy(to->drop, from->drop, sizeof(int32_t) * r->guards);
  memcpy(to->unknowns, from->unknowns, sizeof(double) * r->width);
  to->strict = from->strict;
}

static int rests(const Run *r, const int8_t *letter) {
  for (int i = 0; i < r->width; i++) if (letter[i] == 0) return 1;
  return 0;
}

/* Modes that can continue, so far. */
typedef struct { int strict, found, resting; } Tally;

/* Count r->found, of r->trial. */
static void count_found(Run *r, Tally *t) {
  if (r->found.strict && t->strict++ == 0) copy_continuation(r, &r->one, &r->found);
  if (r->found.strict && r->several_count < SEVERAL) r->several[r->several_count++] = r->trial.l.mode;
  if (t->found++ == 0) copy_continuation(r, &r->first, &r->found);
  if (rests(r, r->found.letter) && t->resting++ == 0) copy_continuation(r, &r->rest, &r->found);
}

/* The one that continues to r->chosen; 0 where there is none, or more than one and the run ends. */
static int choose_of(Run *r, const Tally *t) {
  if (t->strict > 1) { finish(r, NON_UNIQUE, AMBIGUOUS, 0); return 0; }
  if (!t->found || (!t->strict && t->found > 1 && !t->resting)) return 0;
  copy_continuation(r, &r->chosen, t->strict ? &r->one : t->found == 1 ? &r->first : &r->rest);
  return 1;
}

/* Letters of the active elements by the number of a choice of those that are possible. */
static void spell_choice(const Run *r, const int8_t *letter, const int8_t *possible, int number, int8_t *trial) {
  memcpy(trial, letter, r->width);
  for (int i = r->active_count - 1; i >= 0; i--) {
    int which = number % bits(possible[i]);
    number /= bits(possible[i]);
    for (int bit = 0; bit < 3; bit++)
      if (possible[i] >> bit & 1 && which-- == 0) trial[r->active[i]] = bit == 0 ? 1 : bit == 1 ? -1 : 0;
  }
}

static int decide(Run *r, const int8_t *letter, const Known *known, int known_count);

/* Whether sliding on the one active surface would end here, to rounding: then it is left with known zeros. */
static int leaves_at_end(Run *r, const int8_t *letter) {
  int own = r->active[0];
  int8_t *trial = r->tried_letter;
  Expansion *e = &r->trial;
  memcpy(trial, letter, r->width);
  trial[own] = 0;
  lay_out(r, trial, &e->l);
  keep_carried(r, trial, r->found.unknowns);
  if (!improve(r, &e->l, r->x, r->found.unknowns, 1)) return 0;
  expand(r, trial, r->x, r->found.unknowns, e);
  for (int row = 0; row < e->l.rows && e->finite; row++) {
    double value;
    int side = e->l.side[row];
    if (e->l.kind[row] != EXIT_GUARD || e->l.index[row] != own || !leading(r, e, row, 0, &value)) continue;
    Known known[] = {{EXIT_GUARD, own, side, 1}, {SURFACE_GUARD, own, side, 2}};
    return decide(r, letter, known, 2);
  }
  return 0;
}

/* Where no mode continues: stay where all orbits spiral in, leave where sliding ends to rounding, or say why the run
 * ends. */
static int no_motion(Run *r, const int8_t *letter, int known_count) {
  int contacts = 0, k = r->active_count;
  for (int i = 0; i < k; i++) contacts |= r->active[i] >= r->m;
  if (r->status != RUNNING) return 0;
  if (contacts) finish(r, INCONSISTENT, NO_REACTION, 0);
  else if (meets_sets(r)) finish(r, NON_UNIQUE, UNDETERMINED, 0);
  else if (k == 2 && spirals_in(r, letter) && hold_there(r, letter)) return 1;
  else if (k > 1) finish(r, INTERSECTION, NO_STABLE_MOTION, 0);
  else if (!known_count && leaves_at_end(r, letter)) return 1;
  else finish(r, NON_UNIQUE, DEGENERATE, 0);
  return 0;
}

/* One active surface whose rates of h on both sides decide, without series: crossing, entry, and exit where the
 * multiplier is known to pass its bound. The choice to r->chosen; 0 where it is not clear. */
static int decide_by_rates(Run *r, const int8_t *letter, const Known *known, int known_count) {
  int own = r->active[0], w = r->width, exits = known_count && known[0].kind == EXIT_GUARD, chosen = 0;
  double rate[2], *near = r->vector + r->n + w; /* not where inputs are put together */
  if (own >= r->m || !r->s->affine || r->s->scaled[own] || is_idle(r, letter, own)) return 0;
  if (known_count && !(exits && r->falls)) return 0;
  aim(r, letter, r->x, r->unknowns);
  for (int i = 0; i < r->n; i++) near[i] = r->size + fabs(r->x[i]);
  for (int q = 0; q < 2; q++) {
    held_of(r, letter);
    r->held[own] = q ? 1 : -1;
    error_scales(r, r->x, r->held, r->none);
    gradient_sums(r, &r->s->point, r->point, 2 * w + r->s->slope.count, &r->s->layer_gradient, w, near, 1, r->small);
    rate[q] = layer_of(r, own);
    if (!(fabs(rate[q]) > (VANISHES + TANGENT) * r->small[own] && fabs(rate[q]) < INFINITY)) rate[q] = 0;
  }
  if (exits) { /* the other side still leads onto the surface; the rate of this one is zero */
    chosen = known[0].side;
    if (!(rate[chosen < 0] * chosen > 0)) return 0;
  } else if (rate[0] * rate[1] > 0) chosen = rate[0] > 0 ? 1 : -1;
  else if (!(rate[0] > 0 && rate[1] < 0)) return 0;
  Layout *l = &r->trial.l;
  memcpy(r->chosen.letter, letter, w);
  r->chosen.letter[own] = (int8_t)chosen;
  keep_carried(r, r->chosen.letter, r->chosen.unknowns);
  lay_out(r, r->chosen.letter, l);
  if (l->slides && !improve(r, l, r->x, r->chosen.unknowns, 1)) return 0;
  memset(r->chosen.drop, 0, sizeof(int32_t) * r->guards);
  for (int row = 0; row < l->rows; row++)
    if (l->kind[row] == SURFACE_GUARD && l->index[row] == own) r->chosen.drop[row] = exits ? 2 : 1;
  return 1;
}

static int decide_sets(Run *r, const int8_t *letter, const Known *known, int known_count);
static int decide_in_layer(Run *r, const int8_t *letter, const Known *known, int known_count);
static int is_curved(const Run *r, const int32_t *own, int count);

/* Choose, as r->chosen, the motion that continues from a point of the active surfaces; 0 if the run ends.
 * ``letter`` has those of the other surfaces. */
static int decide(Run *r, const int8_t *letter, const Known *known, int known_count) {
  int k = r->active_count, contacts = 0, total = 1;
  int8_t *possible = (int8_t *)r->lam + sizeof(double) * r->width, *trial = possible + r->width;
  Tally tally = {0};
  if (meets_sets(r)) return decide_sets(r, letter, known, known_count);
  if (is_curved(r, r->active, k)) return decide_in_layer(r, letter, known, known_count);
  if (k == 1 && decide_by_rates(r, letter, known, known_count)) return 1;
  for (int i = 0; i < k; i++) contacts |= r->active[i] >= r->m;
  if (k == 1 && !contacts && is_two_fold(r, letter, r->active[0], 0)) {
    finish(r, NON_UNIQUE, TWO_FOLD, r->active[0]);
    return 0;
  }
  if (!by_rates(r, letter, known, known_count, possible)) return 0;
  total = choices_of(possible, k);
  r->several_count = 0;
  for (int number = 0; number < total && r->status == RUNNING; number++) {
    spell_choice(r, letter, possible, number, trial);
    if (continuation(r, trial, known, known_count, &r->found)) count_found(r, &tally);
  }
  if (r->status != RUNNING) return 0;
  return choose_of(r, &tally) || no_motion(r, letter, known_count);
}
