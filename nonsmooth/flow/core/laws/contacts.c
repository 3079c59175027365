/* Impacts ------------------------------------------------------------------------------------------------- */

/* Add what impulses change to ``after``. */
static void add_impulses(Run *r, const double *x, const int8_t *letter, const double *impulses, double *after) {
  set_inputs(r, x, held_of(r, letter), r->none);
  values_at(&r->s->columns, r->input, r->p, r->columns);
  const Entries *column = &r->s->column;
  for (int q = 0; q < column->count; q++) {
    double impulse = impulses[column->column[q]];
    if (impulse != 0) after[column->row[q]] += out_of(&r->s->columns, r->columns, q) * impulse;
  }
}

/* Where the rate is that an impulse of an element changes, among what is kept. */
static int rate_row(const Run *r, int i) {
  const Element *e = element(r, i);
  return e->degree > 1 ? e->lower + e->degree - 2 : i;
}

/* An impact of some elements that act on one another: contacts, friction on them, and joints, whose rates stay zero. */
typedef struct {
  const double *x, *target; /* target: of each contact what its rate changes by */
  int32_t *contact, *carried, contacts, carries, joints; /* carried: friction, then joints */
  int plastic;
} Strike;

/* One possibility: the contacts ``taking`` an impulse, letters of the surfaces that they carry. What it changes is
 * added to ``after``; 0 where it contradicts itself. */
static int impulses_fit(Run *r, const Strike *of, const int32_t *taking, int takes, const int8_t *letter, double *after) {
  int m = r->m, w = r->width, k = 0, joints = of->joints, first;
  int32_t *unknown = r->pending + 4 * w;
  double *every = r->lam, *a = r->matrix, *b = a + (int64_t)w * w, *limit = b + w, *h = limit + w, *scale = h + w, *before = scale + w;
  for (int i = of->carries; i < of->carries + joints; i++) unknown[k++] = of->carried[i];
  for (int i = 0; i < of->carries; i++) if (letter[of->carried[i]] == 0) unknown[k++] = of->carried[i];
  first = k;
  for (int i = 0; i < takes; i++) unknown[k++] = m + taking[i];
  error_scales(r, of->x, held_of(r, letter), r->none);
  for (int i = 0; i < k; i++)
    for (int j = 0; j < k; j++) a[i * k + j] = r->slope[unknown[i] * w + unknown[j]];
  surface_values(r, of->x);
  surface_scales(r, of->x);
  for (int i = 0; i < w; i++) {
    h[i] = r->rates[rate_row(r, i)];
    scale[i] = r->rates[r->kept_rows + rate_row(r, i)];
  }
  for (int i = 0; i < k; i++) b[i] = i < first ? -h[unknown[i]] : of->target[unknown[i] - m];
  if (joints ? !solve_any(a, b, k, TIED, r->decision->work, r->decision->pivot) : !solve(a, b, k)) return 0;
  memset(every, 0, sizeof(double) * w);
  for (int i = 0; i < k; i++) every[unknown[i]] = b[i];
  /* What the impulses change, before r->slope is that of other multipliers. */
  for (int i = 0; i < w; i++) {
    before[i] = h[i];
    for (int j = 0; j < k; j++) if (b[j] != 0) h[i] += r->slope[i * w + unknown[j]] * b[j];
  }
  for (int i = 0; i < k; i++) { /* what depends on other rows may contradict them */
    int own = unknown[i];
    double wanted = i < first ? 0 : before[own] + of->target[own - m];
    if (!(fabs(h[own] - wanted) <= MERGED * (fabs(before[own]) + fabs(wanted)) + ON_SURFACE * scale[own])) return 0;
  }
  for (int j = 0; j < r->c; j++) r->held[m + j] = every[m + j]; /* impulses in place of reactions */
  error_scales(r, of->x, r->held, r->none);
  for (int i = 0; i < m; i++) limit[i] = fabs(factor_of(r, i));
  for (int i = first; i < k; i++) if (!of->plastic && every[unknown[i]] < 0) return 0;
  for (int i = joints; i < first; i++)
    if (!of->plastic && fabs(every[unknown[i]]) > limit[unknown[i]] * (1 + ROOM) + SMALLEST) return 0;
  for (int i = 0; i < of->carries; i++) {
    int own = of->carried[i];
    if (letter[own] && letter[own] * h[own] < -ON_SURFACE * scale[own]) return 0;
  }
  for (int i = 0; i < of->contacts; i++) {
    int own = m + of->contact[i], takes_part = 0;
    for (int q = 0; q < takes; q++) takes_part |= m + taking[q] == own;
    if (!takes_part && h[own] < -ON_SURFACE * scale[own]) return 0;
  }
  add_impulses(r, of->x, letter, every, after);
  return 1;
}

/* One of some contacts whose restitution is not from 0 to 1, or -1. */
static int improper(Run *r, const double *x, const int32_t *involved, int count) {
  values_at(&r->s->restitution, x, r->p, r->restitution);
  for (int i = 0; i < count; i++) {
    double e = out_of(&r->s->restitution, r->restitution, involved[i]);
    if (!(e >= 0 && e <= 1)) return involved[i];
  }
  return -1;
}

/* Contacts in a group of which all subsets are tried, and choices of letters of the surfaces that they carry. */
enum { MOST_TAKING = 12, MOST_CHOICES = 100000 };

/* Impulses of a group by the law of elements, velocities in place of rates: each contact parts with at least the
 * velocity that its restitution gives it, and with no more where it takes an impulse (Moreau). Those that contacts have
 * taken ``before`` bound friction too; to ``taken`` those that they take. 0 where it has none. */
static int strike_by_law(Run *r, const int32_t *own, int n, const Strike *of, const double *before, double *taken, double *after) {
  Decision *d = r->decision;
  int w = r->width, m = r->m, solved;
  int32_t *which = d->own;
  int8_t *letter = (int8_t *)(r->pending + 2 * w), *position = d->block_state + 2 * w;
  int8_t *span = d->block_state + 3 * w;
  double all[MOST_SOLUTIONS * MOST_ENUMERATED];
  Block b = {.size = n, .tie = TIED, .own = which, .a = d->block, .state = d->block_state, .is_contact = d->block_state + w};
  b.b = b.a + n; b.floor = b.b + n; b.matrix = b.floor + n; b.share = b.matrix + n * n;
  memcpy(letter, r->letter, w);
  for (int i = 0; i < n; i++) { which[i] = own[i]; if (own[i] < m) letter[own[i]] = 0; }
  surface_values(r, of->x);
  surface_scales(r, of->x);
  held_of(r, letter);
  for (int j = 0; before && j < r->c; j++) r->held[m + j] = before[j];
  error_scales(r, of->x, r->held, r->none);
  for (int i = 0; i < n; i++) {
    int contact = which[i] >= m, joint = has_law(r, which[i], JOINT_LAW), at = rate_row(r, which[i]);
    int set = set_of(r, which[i]);
    span[i] = (int8_t)(set < 0 ? 0 : which[i] == set ? size_of(r, set) : -1);
    if (set >= 0) b.span = span;
    b.is_contact[i] = (int8_t)contact;
    b.state[i] = joint ? INSIDE : UNDECIDED;
    position[i] = contact || joint || r->letter[which[i]] == 0 ? HELD : r->letter[which[i]] > 0 ? TOP : BOTTOM;
    b.a[i] = contact ? of->target[which[i] - m] : r->rates[at];
    b.floor[i] = VANISHES * r->rates[r->kept_rows + at];
    b.b[i] = contact || joint ? 0 : factor_of(r, which[i]);
    d->sign[i] = contact || joint ? 1 : ns_sign(b.b[i]);
    for (int j = 0; j < n; j++) b.matrix[i * n + j] = (contact ? 1 : -1) * r->slope[which[i] * w + which[j]];
  }
  memset(b.share, 0, sizeof(double) * n * n);
  for (int j = 0; j < n; j++) { /* limits of friction by the impulses */
    if (!b.is_contact[j]) continue;
    r->held[which[j]] += 1;
    error_scales(r, of->x, r->held, r->none);
    r->held[which[j]] -= 1;
    for (int i = 0; i < n; i++) {
      if (b.is_contact[i] || b.state[i] == INSIDE) continue;
      b.share[i * n + j] = factor_of(r, which[i]) - b.b[i];
      if (!d->sign[i]) d->sign[i] = ns_sign(b.share[i * n + j]);
      b.is_coupled |= b.share[i * n + j] != 0;
    }
  }
  for (int i = 0; i < n; i++) { /* a bound that is negative turns its unknown */
    if (!(d->sign[i] < 0)) continue;
    b.b[i] *= -1;
    for (int j = 0; j < n; j++) { b.share[i * n + j] *= -1; b.matrix[j * n + i] *= -1; }
  }
  double *found = d->large, *every = r->lam;
  if (b.span) solved = relax(&b, found, d->work, d->pivot);
  else solved = pivot_block(&b, position, found, 20 + 4 * n, d->work, d->pivot) || lemke_block(&b, found, d->work, d->pivot);
  if (!solved && !b.span && n <= MOST_ENUMERATED && enumerate(&b, all, d->work, d->pivot)) { found = all; solved = 1; }
  if (!solved) return 0;
  memset(every, 0, sizeof(double) * w);
  for (int i = 0; i < n; i++) every[which[i]] = d->sign[i] < 0 ? -found[i] : found[i];
  for (int i = 0; taken && i < n; i++) if (which[i] >= m) taken[which[i] - m] = found[i];
  add_impulses(r, of->x, letter, every, after);
  return 1;
}

/* Impulses of contacts that act on one another: with most contacts and with the present letters first. */
static int strike_by_subsets(Run *r, const Strike *of, double *after) {
  int count = of->contacts, choices = 1, w = r->width;
  int32_t *taking = r->pending + w;
  int8_t *letter = (int8_t *)(r->pending + 2 * w);
  for (int i = 0; i < of->carries; i++) choices = choices < MOST_CHOICES ? 3 * choices : choices;
  if (count > MOST_TAKING || choices > MOST_CHOICES) return 0;
  for (int size = count; size > 0; size--)
    for (int set = (1 << count) - 1; set > 0; set--) {
      int takes = 0;
      for (int i = 0; i < count; i++) if (set >> (count - 1 - i) & 1) taking[takes++] = of->contact[i];
      if (takes != size) continue;
      for (int number = 0; number < choices; number++) {
        int rest = number;
        memcpy(letter, r->letter, w);
        for (int i = of->carries - 1; i >= 0; i--, rest /= 3) {
          static const int8_t order[3][3] = {{-1, 0, 1}, {0, 1, -1}, {1, 0, -1}}; /* present, then s + - */
          letter[of->carried[i]] = order[r->letter[of->carried[i]] + 1][rest % 3];
        }
        if (impulses_fit(r, of, taking, takes, letter, after)) return 1;
      }
    }
  return 0;
}

/* Groups of contacts, of surfaces that they carry and of joints, that act on one another: of each its number. */
static int find_striking(Run *r, const int32_t *involved, int count, int32_t *group) {
  const Entries *slope = &r->s->slope;
  int w = r->width, c = r->c, m = r->m, groups = 0, changed = 1;
  for (int i = 0; i < w; i++) group[i] = -1;
  for (int q = 0; q < count; q++) {
    group[m + involved[q]] = groups++;
    for (int i = 0; i < m; i++) if (r->s->carries[i * c + involved[q]] && group[i] < 0) group[i] = groups++;
  }
  for (int i = 0; i < m; i++) if (has_law(r, i, JOINT_LAW)) group[i] = groups++;
  while (changed) {
    changed = 0;
    for (int e = 0; e < slope->count; e++) {
      int i = group[slope->row[e]], j = group[slope->column[e]];
      if (i < 0 || j < 0 || i == j || r->slope[slope->row[e] * w + slope->column[e]] == 0) continue;
      for (int q = 0; q < w; q++) if (group[q] == (i > j ? i : j)) group[q] = i < j ? i : j;
      changed = 1;
    }
    for (int i = 0; i < m; i++)
      for (int j = 0; j < c; j++) {
        int a = group[i], b = group[m + j];
        if (a < 0 || b < 0 || a == b || !r->s->carries[i * c + j]) continue;
        for (int q = 0; q < w; q++) if (group[q] == (a > b ? a : b)) group[q] = a < b ? a : b;
        changed = 1;
      }
  }
  return groups;
}

/* All groups are struck in turn, by the law of elements or by subsets of the contacts. */
static int strike_groups(Run *r, const double *x, const int32_t *involved, int count, const double *target, int plastic,
                         int by_law, const double *before, double *taken, double *after) {
  int w = r->width, m = r->m, groups;
  int32_t *group = r->decision->mark, *own = group + w;
  error_scales(r, x, held_of(r, r->letter), r->none);
  groups = find_striking(r, involved, count, group);
  for (int g = 0; g < groups; g++) {
    Strike of = {.x = x, .target = target, .contact = r->decision->order, .carried = r->pending, .plastic = plastic};
    int n = 0;
    for (int i = 0; i < w; i++) if (group[i] == g) own[n++] = i;
    for (int i = 0; i < n; i++) if (own[i] >= m) of.contact[of.contacts++] = own[i] - m;
    for (int i = 0; i < n; i++) if (own[i] < m && !has_law(r, own[i], JOINT_LAW)) of.carried[of.carries++] = own[i];
    for (int i = 0; i < n; i++) if (has_law(r, own[i], JOINT_LAW)) of.carried[of.carries + of.joints++] = own[i];
    int in_space = 0;
    for (int i = 0; i < n; i++) in_space |= set_of(r, own[i]) >= 0;
    if (!of.contacts || (!by_law && !in_space && strike_by_subsets(r, &of, after))) continue;
    if (!strike_by_law(r, own, n, &of, before, taken, after)) return 0;
  }
  return 1;
}

/* Poisson's law: impulses that end the approach, then at least the restitution's part of them at each contact. */
static int compress_and_expand(Run *r, const int32_t *involved, int count, double *target, double *after) {
  int m = r->m, c = r->c, any = 0;
  double *taken = target + c, *x = r->saved, *every = r->lam;
  memset(taken, 0, sizeof(double) * c);
  if (!strike_groups(r, r->x, involved, count, target, 0, 1, 0, taken, after)) return 0;
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
  return strike_groups(r, x, involved, count, target, 0, 1, taken, 0, after);
}

/* State after the impulses at some closed gaps; 0 if none are consistent. */
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
  return strike_groups(r, r->x, involved, count, target, plastic, !plastic && law == MOREAU_IMPACTS, 0, 0, after);
}
