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

/* Whether the motion can continue in a mode: its guards that vanish here become positive. */
static int continuation(Run *r, const int8_t *letter, const Known *known, int known_count, Continuation *result) {
  Expansion *e = &r->trial;
  lay_out(r, letter, &e->l);
  if (!meets_sets(r)) keep_carried(r, letter, result->unknowns); /* else they are given */
  if (e->l.slides) {
    if (!is_known(r, &e->l)) { finish(r, HAND_OVER, NO_REASON, 0); return 0; }
    if (!improve(r, &e->l, r->x, result->unknowns, 1)) return 0;
    error_scales(r, r->x, held_of(r, letter), result->unknowns);
    int stable = meets_sets(r) ? 1 : is_stable(r, &e->l); /* M of sets is definite where they are decided */
    if (stable < 0) { finish(r, HAND_OVER, NO_REASON, 0); return 0; }
    if (!stable) return 0;
  }
  expand(r, letter, r->x, result->unknowns, e);
  if (!e->finite) { finish(r, HAND_OVER, NO_REASON, 0); return 0; }
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

/* What is to be said of a point without a motion. */
static int no_motion(Run *r, int contacts) {
  if (contacts) finish(r, INCONSISTENT, NO_REACTION, 0);
  else if (meets_sets(r)) finish(r, HAND_OVER, NO_REASON, 0); /* M is singular, or nearly */
  else if (r->active_count == 2 && r->n == 2) finish(r, HAND_OVER, NO_REASON, 0); /* orbits may spiral in */
  else if (r->active_count > 1) finish(r, INTERSECTION, NO_STABLE_MOTION, 0);
  else finish(r, HAND_OVER, NO_REASON, 0); /* a degenerate tangency: other programs tell zeros apart */
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

/* Choose, as r->chosen, the motion that continues from a point of the active surfaces; 0 if the run ends.
 * ``letter`` has those of the other surfaces. */
static int decide(Run *r, const int8_t *letter, const Known *known, int known_count) {
  int k = r->active_count, contacts = 0, strict = 0, found = 0, resting = 0, total = 1;
  int8_t *possible = (int8_t *)r->lam + sizeof(double) * r->width, *trial = possible + r->width;
  if (meets_sets(r)) return decide_sets(r, letter, known, known_count);
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
    int rest = number;
    memcpy(trial, letter, r->width);
    for (int i = k - 1; i >= 0; i--) { /* the last one first, as the reference does */
      int which = rest % bits(possible[i]);
      rest /= bits(possible[i]);
      for (int bit = 0; bit < 3; bit++)
        if (possible[i] >> bit & 1 && which-- == 0) trial[r->active[i]] = bit == 0 ? 1 : bit == 1 ? -1 : 0;
    }
    if (!continuation(r, trial, known, known_count, &r->found)) continue;
    if (r->found.strict && strict++ == 0) copy_continuation(r, &r->one, &r->found);
    if (r->found.strict && r->several_count < SEVERAL) r->several[r->several_count++] = r->trial.l.mode;
    if (found++ == 0) copy_continuation(r, &r->first, &r->found);
    if (rests(r, trial) && resting++ == 0) copy_continuation(r, &r->rest, &r->found);
  }
  if (r->status != RUNNING) return 0;
  if (strict > 1) { /* rounding may have hidden which: where multipliers are eliminated one sees more */
    int handed = known_count || (r->m == 1 && r->c == 0);
    finish(r, handed ? HAND_OVER : NON_UNIQUE, handed ? NO_REASON : AMBIGUOUS, 0);
    return 0;
  }
  if (strict == 1) copy_continuation(r, &r->chosen, &r->one);
  else if (found == 1) copy_continuation(r, &r->chosen, &r->first);
  else if (resting) copy_continuation(r, &r->chosen, &r->rest);
  else return no_motion(r, contacts);
  return 1;
}
