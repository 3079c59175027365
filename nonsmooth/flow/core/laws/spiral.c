/* Planar orbits around the intersection of two surfaces: r -> ratio r (1 + bend r) in a turn. Where they spiral in, the
 * state reaches the point and stays. A quarter turn begins on one surface at distance r and takes the time
 * first r + second r^2.
 */

/* Rates of two surfaces in a quadrant, and their derivatives by the surfaces; 0 where these are dependent. */
static int in_quadrant(Run *r, const int8_t *letter, const int *sign, double *rate, double *slope) {
  const Entries *of_layer = &r->s->layer_gradient, *of_height = &r->s->height_gradient;
  int w = r->width, first = 2 * w + r->s->slope.count;
  double g[4] = {0}, h[4] = {0};
  held_of(r, letter);
  for (int i = 0; i < 2; i++) r->held[r->active[i]] = sign[i];
  error_scales(r, r->x, r->held, r->none);
  for (int i = 0; i < 2; i++) rate[i] = layer_of(r, r->active[i]);
  for (int i = 0; i < 2; i++) {
    for (int q = 0; q < of_layer->count; q++)
      if (of_layer->row[q] == r->active[i]) g[2 * i + of_layer->column[q]] = out_of(&r->s->point, r->point, first + q);
    for (int q = 0; q < of_height->count; q++)
      if (of_height->row[q] == r->active[i])
        h[2 * i + of_height->column[q]] = out_of(&r->s->point, r->point, first + of_layer->count + q);
  }
  double determinant = h[0] * h[3] - h[1] * h[2];
  for (int i = 0; i < 2; i++) {
    slope[2 * i] = (g[2 * i] * h[3] - g[2 * i + 1] * h[2]) / determinant;
    slope[2 * i + 1] = (g[2 * i + 1] * h[0] - g[2 * i] * h[1]) / determinant;
  }
  return finite_all(slope, 4) && finite_all(rate, 2);
}

/* The return map of one turn, from rates and slopes in the quadrants ++, -+, --, +-; 0 where no orbit returns. A ratio that
 * is 1 to rounding is 1, a bend that is rounding 0. */
static int go_round(double (*rate)[2], double (*slope)[4], double *ratio, double *bend) {
  static const int sign[4][2] = {{1, 1}, {-1, 1}, {-1, -1}, {1, -1}};
  int clockwise = !(rate[0][0] < 0);
  double size = 0;
  *ratio = 1;
  *bend = 0;
  for (int q = 0; q < 4; q++) { /* from the half axis where ``near`` is on its own side to that where it is zero */
    int at = clockwise ? (4 - q) % 4 : q;
    const int *s = sign[at];
    double d[4], accel[2], *f = rate[at];
    int near = (s[0] * s[1] > 0) == !clockwise ? 0 : 1, far = 1 - near;
    double u = f[near] * s[near], v = f[far] * s[far];
    if (!(u < 0 && 0 < v)) return 0;
    for (int i = 0; i < 2; i++) for (int j = 0; j < 2; j++) d[2 * i + j] = slope[at][2 * i + j] * s[i] * s[j];
    for (int i = 0; i < 2; i++) accel[i] = d[2 * i] * f[0] * s[0] + d[2 * i + 1] * f[1] * s[1];
    double first = -1 / u, second = -(d[3 * near] * first + 0.5 * accel[near] * first * first) / u, factor = v * first;
    double grown = (v * second + d[2 * far + near] * first + 0.5 * accel[far] * first * first) / factor;
    *bend += grown * *ratio;
    size += fabs(grown) * *ratio;
    *ratio *= factor;
  }
  if (!(fabs(*ratio * size) < INFINITY)) return 0;
  if (fabs(*ratio - 1) <= TURN_ROUNDING) *ratio = 1;
  if (fabs(*bend) <= TURN_ROUNDING * size) *bend = 0;
  return 1;
}

/* Whether orbits spiral into the intersection of the two active surfaces. */
static int spirals_in(Run *r, const int8_t *letter) {
  static const int sign[4][2] = {{1, 1}, {-1, 1}, {-1, -1}, {1, -1}};
  double ratio, bend, rate[4][2], slope[4][4];
  if (r->n != 2 || r->active_count != 2 || is_half_line(r, r->active[0]) || is_half_line(r, r->active[1])) return 0;
  for (int q = 0; q < 4; q++) if (!in_quadrant(r, letter, sign[q], rate[q], slope[q])) return 0;
  return go_round(rate, slope, &ratio, &bend) && (ratio < 1 || (ratio == 1 && bend < 0));
}

/* Stay at the intersection of two surfaces though no layer attracts: all orbits spiral in, so none leaves. */
static int hold_there(Run *r, const int8_t *letter) {
  Continuation *c = &r->chosen;
  memcpy(c->letter, letter, r->width);
  for (int i = 0; i < 2; i++) c->letter[r->active[i]] = 0;
  keep_carried(r, c->letter, c->unknowns);
  lay_out(r, c->letter, &r->trial.l);
  memset(c->drop, 0, sizeof(int32_t) * r->guards);
  return improve(r, &r->trial.l, r->x, c->unknowns, 2);
}
