/* Modes that are tried one by one, each with all its unknowns: where laws are not linear complementarity (hidden laws,
 * products, sets of codimension two and more). A mode can continue if each of its guards that vanishes here becomes
 * positive at once: its first coefficient that is not zero is positive. */

/* Modes that are tried at most. */
#define TRIED 256

static int bits(int a) { return (a & 1) + (a >> 1 & 1) + (a >> 2 & 1); }

/* Number of the modes that are possible, or one more than are tried. */
static int choices_of(const int8_t *possible, int count) {
  int total = 1;
  for (int i = 0; i < count && total <= TRIED; i++) total *= bits(possible[i]);
  return total <= TRIED ? total : TRIED + 1;
}

static void many_may_hold(Run *r) { finish(r, NON_UNIQUE, POSSIBLY_SEVERAL, 0); }

/* Coefficients that are no numbers decide nothing. */
static void keep_finite(Run *r, Expansion *e) {
  for (int i = 0; i < r->n * r->stride; i++) if (!(fabs(e->states[i]) < INFINITY)) e->states[i] = 0;
  for (int i = 0; i < e->l.rows * r->stride; i++) if (!(fabs(e->guards[i]) < INFINITY)) e->guards[i] = 0;
}

/* Whether sliding is stable across its layers of equal width, closed contacts in balance, from r->slope. */
static int is_stable(Run *r, const Layout *l) {
  int n = l->slides, rows = 0, w = r->width;
  double *a = r->decision->block, *m = r->work;
  while (rows < n && l->sliding[rows] < r->m) rows++;
  for (int i = 0; i < n; i++) {
    double turn = i < rows ? -ns_sign(factor_of(r, l->sliding[i])) : 1;
    for (int j = 0; j < n; j++) m[i * n + j] = turn * r->slope[l->sliding[i] * w + l->sliding[j]];
  }
  for (int q = n - 1; q >= rows; q--)
    for (int i = 0; i < q && m[q * n + q] != 0; i++) {
      double f = m[i * n + q] / m[q * n + q];
      for (int j = 0; j < q && f != 0; j++) m[i * n + j] -= f * m[q * n + j];
    }
  for (int i = 0; i < rows; i++) for (int j = 0; j < rows; j++) a[i * rows + j] = m[i * n + j];
  return rows == 0 || is_positive_stable(a, rows, r->decision->work);
}

/* Whether the motion can continue in a mode with given unknowns: its guards that vanish here become positive. */
static int continues(Run *r, const int8_t *letter, const Known *known, int known_count, Continuation *result) {
  Expansion *e = &r->trial;
  lay_out(r, letter, &e->l);
  if (e->l.slides) {
    error_scales(r, r->x, held_of(r, letter), result->unknowns);
    if (!is_stable(r, &e->l)) return 0;
  }
  expand(r, letter, r->x, result->unknowns, e);
  if (!e->finite) keep_finite(r, e);
  memcpy(result->letter, letter, r->width);
  result->strict = 1;
  memset(result->drop, 0, sizeof(int32_t) * r->guards);
  for (int row = 0; row < e->l.rows; row++) {
    int kind = e->l.kind[row], index = e->l.index[row], of = index, active = 0, zeros = 0;
    if (is_atom(kind)) continue;
    if (kind == NEAR_GUARD && letter[index] == 0) continue; /* ends steps only */
    if (kind == IMPACT_GUARD || kind == RELEASE_GUARD) of += r->m;
    for (int i = 0; i < r->active_count; i++) active |= r->active[i] == of;
    if (!active) continue;
    for (int i = 0; i < known_count; i++)
      if (known[i].kind == kind && known[i].index == index && known[i].side == e->l.side[row]) zeros = known[i].zeros;
    if (kind == SURFACE_GUARD && zeros < r->s->degree[index]) zeros = r->s->degree[index];
    if (kind == NEAR_GUARD && zeros < 1) zeros = 1;
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
