/* Impacts: nonsmooth/flow/reference/contacts.py ------------------------------------------------------- */

/* One possibility: the contacts ``taking`` an impulse, letters of the surfaces that they carry. The state
 * after it to ``after``; 0 where it contradicts itself. */
static int impulses_fit(Run *r, const double *x, const int32_t *involved, int count, const int32_t *taking, int takes,
                        const int8_t *letter, const int32_t *carried, int carries, const double *target, int plastic,
                        double *after) {
  int m = r->m, w = r->width, k = 0, n = r->n;
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
    if (!plastic && fabs(every[unknown[i]]) > limit[unknown[i]] * (1 + 1e-9) + 1e-300) return 0;
  for (int i = 0; i < carries; i++) {
    int own = carried[i];
    if (letter[own] && letter[own] * h[own] < -ON_SURFACE * scale[own]) return 0;
  }
  for (int i = 0; i < count; i++) {
    int j = involved[i], takes_part = 0;
    for (int q = 0; q < takes; q++) takes_part |= taking[q] == j;
    if (!takes_part && h[m + j] < -ON_SURFACE * scale[m + r->c + j]) return 0;
  }
  memcpy(after, x, sizeof(double) * n);
  set_inputs(r, x, held_of(r, letter), r->none);
  values_run(&r->s->columns, r->input, r->p, r->columns);
  const Entries *column = &r->s->column;
  for (int q = 0; q < column->count; q++) {
    double impulse = every[column->column[q]];
    if (impulse != 0) after[column->row[q]] += out_of(&r->s->columns, r->columns, q) * impulse;
  }
  return 1;
}

/* One of some contacts whose restitution is not from 0 to 1, or -1. */
static int improper(Run *r, const double *x, const int32_t *involved, int count) {
  values_run(&r->s->restitution, x, r->p, r->restitution);
  for (int i = 0; i < count; i++) {
    double e = out_of(&r->s->restitution, r->restitution, involved[i]);
    if (!(e >= 0 && e <= 1)) return involved[i];
  }
  return -1;
}

/* State after the impulses at some closed gaps; 0 if none are consistent. All possibilities are tried, with
 * most contacts and with the present letters first. */
static int strike(Run *r, const int32_t *involved, int count, int plastic, double *after) {
  int m = r->m, c = r->c, carries = 0, choices = 1;
  int32_t *carried = r->pending, *taking = carried + r->width;
  int8_t *letter = (int8_t *)(r->pending + 2 * r->width);
  double *target = r->rates + 2 * r->kept_rows, *x = r->x;
  const double *h = surface_values(r, x);
  if (!plastic) values_run(&r->s->restitution, x, r->p, r->restitution);
  for (int j = 0; j < c; j++) {
    double rate = h[m + c + j], e = plastic ? 0 : out_of(&r->s->restitution, r->restitution, j);
    target[j] = plastic || !(rate < 0) ? -rate : -(1 + e) * rate;
  }
  for (int i = 0; i < m; i++) {
    int borne = 0;
    for (int q = 0; q < count; q++) borne |= r->s->carries[i * c + involved[q]];
    if (borne) { carried[carries++] = i; choices = choices < 100000 ? 3 * choices : choices; }
  }
  if (count > 12 || choices > 100000) { many_may_hold(r); return 0; }
  for (int size = count; size > 0; size--)
    for (int set = (1 << count) - 1; set > 0; set--) {
      int takes = 0;
      for (int i = 0; i < count; i++) if (set >> (count - 1 - i) & 1) taking[takes++] = involved[i];
      if (takes != size) continue;
      for (int number = 0; number < choices; number++) {
        int rest = number;
        memcpy(letter, r->letter, r->width);
        for (int i = carries - 1; i >= 0; i--, rest /= 3) {
          static const int8_t order[3][3] = {{-1, 0, 1}, {0, 1, -1}, {1, 0, -1}}; /* present, then s + - */
          letter[carried[i]] = order[r->letter[carried[i]] + 1][rest % 3];
        }
        if (impulses_fit(r, x, involved, count, taking, takes, letter, carried, carries, target, plastic, after))
          return 1;
      }
    }
  return 0;
}
