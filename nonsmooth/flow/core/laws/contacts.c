/* Impacts ------------------------------------------------------------------------------------------------- */

/* Add the jump of impulses to ``after``. */
static void add_impulses(Run *r, const double *x, const int8_t *letter, const double *impulses, double *after) {
  set_inputs(r, x, held_of(r, letter), r->none);
  values_at(&r->s->columns, r->input, r->p, r->columns);
  const Entries *column = &r->s->column;
  for (int q = 0; q < column->count; q++) {
    double impulse = impulses[column->column[q]];
    if (impulse != 0) after[column->row[q]] += out_of(&r->s->columns, r->columns, q) * impulse;
  }
}

/* Row of the rate that an impulse of an element changes, among the functions kept at zero. */
static int rate_row(const Run *r, int i) {
  const Element *e = element(r, i);
  return e->degree > 1 ? e->lower + e->degree - 2 : i;
}

/* A contact whose restitution is outside [0, 1], or -1. */
static int improper(Run *r, const double *x, const int32_t *involved, int count) {
  values_at(&r->s->restitution, x, r->p, r->restitution);
  for (int i = 0; i < count; i++) {
    double e = out_of(&r->s->restitution, r->restitution, involved[i]);
    if (!(e >= 0 && e <= 1)) return involved[i];
  }
  return -1;
}

/* Largest number of contacts whose subsets are all tried, and of choices of letters of the surfaces that they carry. */
enum { MOST_TAKING = 12, MOST_CHOICES = 100000 };

/* Whether a trial satisfies Newton's law: contacts without an impulse separate at their velocity of restitution less
 * ``slack`` at least. Plastic impulses may have any size and sign. */
static int is_of_newton(const Block *k, const int8_t *position, const double *nu, const double *slack, int plastic) {
  for (int i = 0; i < k->size; i++) {
    double terms, w = rate_of(k, i, nu, &terms);
    int is_open = k->is_contact[i] && position[i] == BOTTOM, is_free = is_open || (plastic && position[i] == HELD);
    if (is_open ? w > slack[i] + zero_of(k, i, terms) : !is_free && next_position(k, i, position[i], nu) != position[i]) return 0;
  }
  return 1;
}

/* Impulses by Newton's law on as many contacts as possible, the present positions first; 0 where there are none, or too
 * many possibilities. */
static int take_most(const Block *k, int8_t *position, const double *slack, int plastic, double *found, double *work,
                     int32_t *pivot) {
  static const int8_t order[3][3] = {{HELD, TOP, BOTTOM}, {TOP, HELD, BOTTOM}, {BOTTOM, HELD, TOP}};
  int contact[MOST_TAKING], carried[MOST_TAKING], present[MOST_TAKING], contacts = 0, carries = 0, choices = 1;
  for (int i = 0; i < k->size; i++) {
    if (k->state[i] == INSIDE) continue; /* a joint */
    if (k->is_contact[i] ? contacts == MOST_TAKING : 3 * choices > MOST_CHOICES) return 0;
    if (k->is_contact[i]) { contact[contacts++] = i; continue; }
    present[carries] = position[i];
    carried[carries++] = i;
    choices *= 3;
  }
  for (int size = contacts; size > 0; size--)
    for (int set = (1 << contacts) - 1; set > 0; set--)
      for (int number = 0; number < choices && __builtin_popcount(set) == size; number++) {
        for (int i = 0; i < contacts; i++) position[contact[i]] = set >> (contacts - 1 - i) & 1 ? HELD : BOTTOM;
        for (int i = carries - 1, rest = number; i >= 0; i--, rest /= 3) position[carried[i]] = order[present[i]][rest % 3];
        if (place_unknowns(k, position, found, work, pivot) && is_of_newton(k, position, found, slack, plastic)) return 1;
      }
  for (int i = 0; i < contacts; i++) position[contact[i]] = HELD;
  for (int i = 0; i < carries; i++) position[carried[i]] = (int8_t)present[i];
  return 0;
}

/* An impact: of each contact the change of its rate; whether impulses may have any sign; whether by the law of elements;
 * earlier impulses of the contacts, which bound friction too, or none. */
typedef struct { const double *x, *target, *before; int plastic, by_law; } Strike;

/* Impulses of a group of coupled elements by their law at the level of velocities (Moreau): each contact separates with at
 * least its velocity of restitution, and with exactly that where its impulse is positive. ``taken`` gets the impulses of
 * contacts; 0 where there are none. */
static int strike_group(Run *r, const int32_t *own, int n, const Strike *of, double *taken, double *after) {
  Decision *d = r->decision;
  int w = r->width, m = r->m, solved;
  int8_t *letter = (int8_t *)(r->pending + 2 * w), *position = d->large_class;
  double all[MOST_SOLUTIONS * MOST_ENUMERATED], *slack = d->old, *found = d->large, *every = r->lam;
  Block b = {.size = n, .tie = TIED, .own = d->own, .a = d->a, .b = d->b, .matrix = d->matrix, .share = d->share,
             .floor = d->floor, .state = d->state, .is_contact = d->is_contact};
  d->count = n;
  memcpy(letter, r->letter, w);
  for (int i = 0; i < n; i++) { d->own[i] = own[i]; if (own[i] < m) letter[own[i]] = 0; }
  surface_values(r, of->x);
  surface_scales(r, of->x);
  held_of(r, letter);
  for (int j = 0; of->before && j < r->c; j++) r->held[m + j] = of->before[j];
  error_scales(r, of->x, r->held, r->none);
  for (int i = 0; i < n; i++) {
    int contact = own[i] >= m, joint = has_law(r, own[i], JOINT_LAW), at = rate_row(r, own[i]), set = set_of(r, own[i]);
    d->span[i] = (int8_t)(set < 0 ? 0 : own[i] == set ? size_of(r, set) : -1);
    if (set >= 0) b.span = d->span;
    d->is_contact[i] = (int8_t)contact;
    d->is_idle[i] = (int8_t)joint;
    d->state[i] = joint ? INSIDE : UNDECIDED;
    position[i] = contact || joint || r->letter[own[i]] == 0 ? HELD : r->letter[own[i]] > 0 ? TOP : BOTTOM;
    d->a[i] = contact ? of->target[own[i] - m] : r->rates[at];
    slack[i] = contact ? larger(d->a[i] + r->rates[at], 0) : 0;
    d->floor[i] = VANISHES * r->rates[r->kept_rows + at];
    d->b[i] = contact || joint ? 0 : factor_of(r, own[i]);
    for (int j = 0; j < n; j++) d->matrix[i * n + j] = (contact ? 1 : -1) * r->slope[own[i] * w + own[j]];
  }
  read_shares(r, d, of->x);
  for (int i = 0; i < n * n; i++) b.is_coupled |= d->share[i] != 0;
  solved = !of->by_law && !b.span && take_most(&b, position, slack, of->plastic, found, d->work, d->pivot);
  if (!solved && b.span) solved = relax(&b, found, d->work, d->pivot);
  else if (!solved) solved = pivot_block(&b, position, found, 20 + 4 * n, d->work, d->pivot) || lemke_block(&b, found, d->work, d->pivot);
  if (!solved && !b.span && n <= MOST_ENUMERATED && enumerate(&b, all, d->work, d->pivot)) { found = all; solved = 1; }
  if (!solved) return 0;
  memset(every, 0, sizeof(double) * w);
  for (int i = 0; i < n; i++) every[own[i]] = d->sign[i] * found[i];
  for (int i = 0; taken && i < n; i++) if (own[i] >= m) taken[own[i] - m] = found[i];
  add_impulses(r, of->x, letter, every, after);
  return 1;
}

/* The group of each element: contacts, surfaces that they carry and joints that are coupled. */
static int find_striking(Run *r, const int32_t *involved, int count, int32_t *group) {
  const Entries *slope = &r->s->slope;
  int w = r->width, c = r->c, m = r->m, groups = 0;
  for (int i = 0; i < w; i++) group[i] = -1;
  for (int q = 0; q < count; q++) {
    group[m + involved[q]] = groups++;
    for (int i = 0; i < m; i++) if (r->s->carries[i * c + involved[q]] && group[i] < 0) group[i] = groups++;
  }
  for (int i = 0; i < m; i++) if (has_law(r, i, JOINT_LAW)) group[i] = groups++;
  for (int e = 0; e < slope->count; e++)
    if (r->slope[slope->row[e] * w + slope->column[e]] != 0) join_groups(group, w, slope->row[e], slope->column[e]);
  for (int i = 0; i < m; i++) for (int j = 0; j < c; j++) if (r->s->carries[i * c + j]) join_groups(group, w, i, m + j);
  return groups;
}

/* Apply the impulses of all groups in turn. */
static int strike_groups(Run *r, const int32_t *involved, int count, const Strike *of, double *taken, double *after) {
  int w = r->width;
  int32_t *group = r->decision->mark, *own = group + w;
  error_scales(r, of->x, held_of(r, r->letter), r->none);
  int groups = find_striking(r, involved, count, group);
  for (int g = 0; g < groups; g++) {
    int n = 0;
    for (int i = 0; i < w; i++) if (group[i] == g) own[n++] = i;
    if (n && own[n - 1] >= r->m && !strike_group(r, own, n, of, taken, after)) return 0; /* not of joints alone */
  }
  return 1;
}

/* Poisson's law: impulses that end the compression, then at each contact at least its restitution times them. */
static int compress_and_expand(Run *r, const int32_t *involved, int count, double *target, double *after) {
  int m = r->m, c = r->c, any = 0;
  double *taken = target + c, *x = r->saved, *every = r->lam;
  memset(taken, 0, sizeof(double) * c);
  Strike first = {.x = r->x, .target = target, .by_law = 1}, rest = {.x = x, .target = target, .before = taken, .by_law = 1};
  if (!strike_groups(r, involved, count, &first, taken, after)) return 0;
  for (int j = 0; j < c; j++) any |= (taken[j] *= out_of(&r->s->restitution, r->restitution, j)) > 0;
  if (!any) return 1;
  memcpy(x, after, sizeof(double) * r->n);
  memset(every, 0, sizeof(double) * r->width);
  memcpy(every + m, taken, sizeof(double) * c);
  memcpy(r->start, r->letter, r->width);
  for (int i = 0; i < m; i++) /* no friction yet */
    for (int j = 0; j < c; j++) if (r->s->carries[i * c + j]) r->start[i] = 0;
  add_impulses(r, r->x, r->start, every, x);
  const double *h = surface_values(r, x);
  for (int j = 0; j < c; j++) target[j] = -h[m + c + j];
  memcpy(after, x, sizeof(double) * r->n);
  return strike_groups(r, involved, count, &rest, 0, after);
}

/* The state after the impulses at some closed gaps; 0 if none are consistent. */
static int strike(Run *r, const int32_t *involved, int count, int plastic, double *after) {
  int c = r->c, law = r->s->impact_law;
  double *target = r->rates + 2 * r->kept_rows;
  const double *h = surface_values(r, r->x);
  if (!plastic) values_at(&r->s->restitution, r->x, r->p, r->restitution);
  for (int j = 0; j < c; j++) {
    double rate = h[r->m + c + j], e = plastic || law == POISSON_IMPACTS ? 0 : out_of(&r->s->restitution, r->restitution, j);
    target[j] = plastic || !(rate < 0) ? -rate : -(1 + e) * rate;
  }
  memcpy(after, r->x, sizeof(double) * r->n);
  if (!plastic && law == POISSON_IMPACTS) return compress_and_expand(r, involved, count, target, after);
  Strike of = {.x = r->x, .target = target, .plastic = plastic, .by_law = !plastic && law == MOREAU_IMPACTS};
  return strike_groups(r, involved, count, &of, 0, after);
}
