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

/* One possibility: the contacts ``taking`` an impulse, letters of the surfaces that they carry. What it changes is
 * added to ``after``; 0 where it contradicts itself. */
static int impulses_fit(Run *r, const double *x, const int32_t *involved, int count, const int32_t *taking, int takes,
                        const int8_t *letter, const int32_t *carried, int carries, const double *target, int plastic,
                        double *after) {
  int m = r->m, w = r->width, k = 0;
  int32_t *unknown = r->pending + 4 * w;
  double *every = r->lam, *a = r->matrix, *b = a + (int64_t)w * w, *limit = b + w, *h = limit + w, *scale = h + w + r->c;
  for (int i = 0; i < carries; i++) if (letter[carried[i]] == 0) unknown[k++] = carried[i];
  int stuck = k;
  for (int i = 0; i < takes; i++) unknown[k++] = m + taking[i];
  error_scales(r, x, held_of(r, letter), r->none);
  for (int i = 0; i < k; i++)
    for (int j = 0; j < k; j++) a[i * k + j] = r->slope[unknown[i] * w + unknown[j]];
  surface_values(r, x);
  memcpy(scale, surface_scales(r, x), sizeof(double) * r->kept_rows);
  memcpy(h, r->rates, sizeof(double) * m);
  for (int j = 0; j < r->c; j++) h[m + j] = r->rates[m + r->c + j];
  for (int i = 0; i < k; i++) b[i] = i < stuck ? -h[unknown[i]] : target[unknown[i] - m];
  if (!solve(a, b, k)) return 0;
  memset(every, 0, sizeof(double) * w);
  for (int i = 0; i < k; i++) every[unknown[i]] = b[i];
  /* What the impulses change, before r->slope is that of other multipliers. */
  for (int i = 0; i < w; i++)
    for (int j = 0; j < k; j++) if (b[j] != 0) h[i] += r->slope[i * w + unknown[j]] * b[j];
  for (int j = 0; j < r->c; j++) r->held[m + j] = every[m + j]; /* impulses in place of reactions */
  error_scales(r, x, r->held, r->none);
  for (int i = 0; i < m; i++) limit[i] = fabs(factor_of(r, i));
  for (int i = 0; i < takes; i++) if (!plastic && every[m + taking[i]] < 0) return 0;
  for (int i = 0; i < stuck; i++)
    if (!plastic && fabs(every[unknown[i]]) > limit[unknown[i]] * (1 + ROOM) + SMALLEST) return 0;
  for (int i = 0; i < carries; i++) {
    int own = carried[i];
    if (letter[own] && letter[own] * h[own] < -ON_SURFACE * scale[own]) return 0;
  }
  for (int i = 0; i < count; i++) {
    int j = involved[i], takes_part = 0;
    for (int q = 0; q < takes; q++) takes_part |= taking[q] == j;
    if (!takes_part && h[m + j] < -ON_SURFACE * scale[m + r->c + j]) return 0;
  }
  add_impulses(r, x, letter, every, after);
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
 * velocity that its restitution gives it, and with no more where it takes an impulse (Moreau). 0 where it has none. */
static int strike_by_law(Run *r, const double *x, const int32_t *own, int n, const double *target, double *after) {
  Decision *d = r->decision;
  int w = r->width, m = r->m, solved;
  int32_t *which = d->own;
  int8_t *letter = (int8_t *)(r->pending + 2 * w), *position = d->block_state + 2 * w;
  Block b = {.size = n, .tie = TIED, .own = which, .a = d->block, .state = d->block_state, .is_contact = d->block_state + w};
  b.b = b.a + n; b.floor = b.b + n; b.matrix = b.floor + n; b.share = b.matrix + n * n;
  memcpy(letter, r->letter, w);
  for (int i = 0; i < n; i++) { which[i] = own[i]; if (own[i] < m) letter[own[i]] = 0; }
  surface_values(r, x);
  const double *scale = surface_scales(r, x);
  error_scales(r, x, held_of(r, letter), r->none);
  for (int i = 0; i < n; i++) {
    int contact = which[i] >= m, at = contact ? which[i] + r->c : which[i];
    b.is_contact[i] = (int8_t)contact;
    b.state[i] = UNDECIDED;
    position[i] = contact || r->letter[which[i]] == 0 ? HELD : r->letter[which[i]] > 0 ? TOP : BOTTOM;
    b.a[i] = contact ? target[which[i] - m] : r->rates[at];
    b.floor[i] = VANISHES * scale[at];
    b.b[i] = contact ? 0 : fabs(factor_of(r, which[i]));
    for (int j = 0; j < n; j++) b.matrix[i * n + j] = (contact ? 1 : -1) * r->slope[which[i] * w + which[j]];
  }
  memset(b.share, 0, sizeof(double) * n * n);
  for (int j = 0; j < n; j++) { /* limits of friction by the impulses */
    if (!b.is_contact[j]) continue;
    r->held[which[j]] = 1;
    error_scales(r, x, r->held, r->none);
    r->held[which[j]] = 0;
    for (int i = 0; i < n; i++) if (!b.is_contact[i]) b.share[i * n + j] = fabs(factor_of(r, which[i])) - b.b[i];
    for (int i = 0; i < n; i++) b.is_coupled |= b.share[i * n + j] != 0;
  }
  double *found = d->large, *every = r->lam;
  solved = pivot_block(&b, position, found, 20 + 4 * n, d->work, d->pivot) || lemke_block(&b, found, d->work, d->pivot);
  if (!solved) return 0;
  memset(every, 0, sizeof(double) * w);
  for (int i = 0; i < n; i++) every[which[i]] = found[i];
  add_impulses(r, x, letter, every, after);
  return 1;
}

/* Impulses of contacts that act on one another: with most contacts and with the present letters first. */
static int strike_group(Run *r, const int32_t *own, int n, const double *target, int plastic, double *after) {
  int carries = 0, count = 0, choices = 1, w = r->width;
  int32_t *carried = r->pending, *taking = carried + w, *involved = r->decision->order;
  int8_t *letter = (int8_t *)(r->pending + 2 * w);
  for (int i = 0; i < n; i++) {
    if (own[i] >= r->m) { involved[count++] = own[i] - r->m; continue; }
    carried[carries++] = own[i];
    choices = choices < MOST_CHOICES ? 3 * choices : choices;
  }
  int is_small = count <= MOST_TAKING && choices <= MOST_CHOICES;
  for (int size = count; is_small && size > 0; size--)
    for (int set = (1 << count) - 1; set > 0; set--) {
      int takes = 0;
      for (int i = 0; i < count; i++) if (set >> (count - 1 - i) & 1) taking[takes++] = involved[i];
      if (takes != size) continue;
      for (int number = 0; number < choices; number++) {
        int rest = number;
        memcpy(letter, r->letter, w);
        for (int i = carries - 1; i >= 0; i--, rest /= 3) {
          static const int8_t order[3][3] = {{-1, 0, 1}, {0, 1, -1}, {1, 0, -1}}; /* present, then s + - */
          letter[carried[i]] = order[r->letter[carried[i]] + 1][rest % 3];
        }
        if (impulses_fit(r, r->x, involved, count, taking, takes, letter, carried, carries, target, plastic, after))
          return 1;
      }
    }
  return strike_by_law(r, r->x, own, n, target, after);
}

/* Groups of contacts, and of surfaces that they carry, that act on one another: of each its number. */
static int find_striking(Run *r, const int32_t *involved, int count, int32_t *group) {
  const Entries *slope = &r->s->slope;
  int w = r->width, c = r->c, m = r->m, groups = 0, changed = 1;
  for (int i = 0; i < w; i++) group[i] = -1;
  for (int q = 0; q < count; q++) {
    group[m + involved[q]] = groups++;
    for (int i = 0; i < m; i++) if (r->s->carries[i * c + involved[q]] && group[i] < 0) group[i] = groups++;
  }
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

/* State after the impulses at some closed gaps; 0 if none are consistent. */
static int strike(Run *r, const int32_t *involved, int count, int plastic, double *after) {
  int m = r->m, c = r->c, w = r->width;
  double *target = r->rates + 2 * r->kept_rows, *x = r->x;
  int32_t *group = r->decision->mark, *own = group + w;
  const double *h = surface_values(r, x);
  if (!plastic) values_at(&r->s->restitution, x, r->p, r->restitution);
  for (int j = 0; j < c; j++) {
    double rate = h[m + c + j], e = plastic ? 0 : out_of(&r->s->restitution, r->restitution, j);
    target[j] = plastic || !(rate < 0) ? -rate : -(1 + e) * rate;
  }
  memcpy(after, x, sizeof(double) * r->n);
  error_scales(r, x, held_of(r, r->letter), r->none);
  int groups = find_striking(r, involved, count, group);
  for (int g = 0; g < groups; g++) {
    int n = 0;
    for (int i = 0; i < w; i++) if (group[i] == g) own[n++] = i;
    if (n && !strike_group(r, own, n, target, plastic, after)) return 0;
  }
  return 1;
}
