/* Grids of signed distance from triangles.

   Distances are exact up to `BAND` cells from the surface; farther out they grow from node to node, which is never too
   small and at most a tenth too large. Inside is where two of three rays, along x, y and z, cross the surface an odd
   number of times, so that small holes in a mesh do no harm. A cell in which distance is no linear function, because an
   edge or a corner is near, gets the list of all triangles that can be nearest within it. */
#include "surfaces.h"

#include <stdlib.h>

#define BAND 2.5
#define REACH 4.0  /* cells; how far from a listed cell's centre its triangles lie, at most */
#define FAR 1e9f
#define ALMOST 0.999999 /* of a distance from a plane, beside rounding */
#define RUN 16     /* triangles, or runs of them, with a box around */

/* Least and largest corner of some triangles (count), and of what is there already. */
static void widen(const double* corner, int64_t count, double* box) {
  for (int64_t n = 0; n < 3 * count; n++)
    for (int x = 0; x < 3; x++) {
      box[x] = smaller(box[x], corner[3 * n + x]);
      box[3 + x] = larger(box[3 + x], corner[3 * n + x]);
    }
}

/* `off`: how far the place is from the triangle's plane, or box, and a little less: the triangle itself is no nearer. */
typedef void (*Visit)(void* what, int64_t node, int64_t triangle, const double* corner, const double* place, double off);

/* Call a function at every node (at cell centres: shift 0.5) whose distance from a triangle's plane, and box, is small. */
static INLINE void near_triangle(const Grid* g, const Mesh* mesh, int64_t t, double reach, double shift, Visit visit, void* what) {
  const double *corner = mesh->corner + 9 * t, *n = mesh->normal + 21 * t;
  int64_t low[3], high[3], at[3];
  double box[6] = {FAR, FAR, FAR, -FAR, -FAR, -FAR};
  int a = 0;
  widen(corner, 1, box);
  for (int x = 0; x < 3; x++) {
    double least = box[x] - reach, most = box[3 + x] + reach;
    int64_t first = -below(-((least - g->origin[x]) / g->cell - shift)), last = below((most - g->origin[x]) / g->cell - shift);
    if (last < 0 || first > g->size[x] - 1) return;
    low[x] = first > 0 ? first : 0;
    high[x] = last < g->size[x] - 1 ? last : g->size[x] - 1;
    if (fabs(n[x]) > fabs(n[a])) a = x;
  }
  int u = (a + 1) % 3, v = (a + 2) % 3;
  double place[3], level = dot(n, corner), across = reach / larger(fabs(n[a]), 0.5), steep = ALMOST * fabs(n[a]);
  for (at[u] = low[u]; at[u] <= high[u]; at[u]++)
    for (at[v] = low[v]; at[v] <= high[v]; at[v]++) {
      place[u] = g->origin[u] + g->cell * ((double)at[u] + shift);
      place[v] = g->origin[v] + g->cell * ((double)at[v] + shift);
      double height = (level - n[u] * place[u] - n[v] * place[v]) / n[a];
      int64_t k = -below(-((height - across - g->origin[a]) / g->cell - shift));
      int64_t end = below((height + across - g->origin[a]) / g->cell - shift);
      if (k < low[a]) k = low[a];
      if (end > high[a]) end = high[a];
      double beside = larger(larger(box[u] - place[u], place[u] - box[3 + u]), larger(box[v] - place[v], place[v] - box[3 + v]));
      for (; k <= end; k++) {
        at[a] = k;
        place[a] = g->origin[a] + g->cell * ((double)k + shift);
        double off = larger(beside, larger(box[a] - place[a], place[a] - box[3 + a]));
        visit(what, node_of(g, at[0], at[1], at[2]), t, corner, place, larger(ALMOST * off, steep * fabs(place[a] - height)));
      }
    }
}

static INLINE void lower(void* what, int64_t node, int64_t t, const double* corner, const double* place, double off) {
  (void)t;
  float* value = (float*)what + node;
  if (off > (double)*value) return;
  float d = (float)distance_to(corner, place);
  if (d < *value) *value = d;
}

/* Beyond the band: distance by steps to the 26 neighbours, from one corner of the grid and back. */
static void spread(const Grid* g, float* value) {
  int64_t nx = g->size[0], ny = g->size[1], nz = g->size[2];
  float near = (float)(BAND * g->cell), length[13];
  int64_t step[13], way[13][3];
  int count = 0;
  for (int di = 0; di < 2; di++)
    for (int dj = di ? -1 : 0; dj < 2; dj++)
      for (int dk = (di || dj) ? -1 : 1; dk < 2; dk++, count++) {
        way[count][0] = di, way[count][1] = dj, way[count][2] = dk;
        step[count] = node_of(g, di, dj, dk);
        length[count] = (float)(g->cell * sqrt((double)(di * di + dj * dj + dk * dk)));
      }
  for (int sign = -1; sign < 2; sign += 2)
    for (int64_t a = 0; a < nx; a++)
      for (int64_t b = 0; b < ny; b++)
        for (int64_t c = 0; c < nz; c++) {
          int64_t i = sign > 0 ? nx - 1 - a : a, j = sign > 0 ? ny - 1 - b : b, k = sign > 0 ? nz - 1 - c : c;
          float *here = value + node_of(g, i, j, k), best = *here;
          if (best < near) continue;
          int inner = i > 0 && j > 0 && k > 0 && i < nx - 1 && j < ny - 1 && k < nz - 1;
          for (int n = 0; n < count; n++) {
            if (!inner) {
              int64_t x = i + sign * way[n][0], y = j + sign * way[n][1], z = k + sign * way[n][2];
              if (x < 0 || y < 0 || z < 0 || x >= nx || y >= ny || z >= nz) continue;
            }
            float d = here[sign * step[n]] + length[n];
            best = d < best ? d : best;
          }
          *here = best;
        }
}

/* Add a vote for each node that lies inside as seen along axis a. */
static void cast(const Grid* g, const Mesh* mesh, int a, uint8_t* crossed, uint8_t* votes) {
  int u = (a + 1) % 3, v = (a + 2) % 3;
  double su = g->origin[u] + 3.1e-5 * g->cell, sv = g->origin[v] + 5.7e-5 * g->cell;  /* off the mesh's own corners */
  memset(crossed, 0, (size_t)(g->size[0] * g->size[1] * g->size[2]));
  for (int64_t t = 0; t < mesh->count; t++) {
    const double *p = mesh->corner + 9 * t, *q = p + 3, *r = p + 6;
    double area = (q[u] - p[u]) * (r[v] - p[v]) - (q[v] - p[v]) * (r[u] - p[u]);
    if (area == 0) continue;
    int64_t lu = -below(-((smaller(p[u], smaller(q[u], r[u])) - su) / g->cell));
    int64_t lv = -below(-((smaller(p[v], smaller(q[v], r[v])) - sv) / g->cell));
    int64_t hu = below((larger(p[u], larger(q[u], r[u])) - su) / g->cell);
    int64_t hv = below((larger(p[v], larger(q[v], r[v])) - sv) / g->cell);
    if (hu > g->size[u] - 1) hu = g->size[u] - 1;
    if (hv > g->size[v] - 1) hv = g->size[v] - 1;
    for (int64_t i = lu > 0 ? lu : 0; i <= hu; i++)
      for (int64_t j = lv > 0 ? lv : 0; j <= hv; j++) {
        double x = su + g->cell * (double)i, y = sv + g->cell * (double)j;
        double wp = (q[u] - x) * (r[v] - y) - (q[v] - y) * (r[u] - x);
        double wq = (r[u] - x) * (p[v] - y) - (r[v] - y) * (p[u] - x);
        double wr = (p[u] - x) * (q[v] - y) - (p[v] - y) * (q[u] - x);
        if (!((wp > 0 && wq > 0 && wr > 0) || (wp < 0 && wq < 0 && wr < 0))) continue;
        int64_t k = -below(-(((wp * p[a] + wq * q[a] + wr * r[a]) / (wp + wq + wr) - g->origin[a]) / g->cell));
        if (k > g->size[a] - 1) continue;
        int64_t at[3];
        at[a] = k > 0 ? k : 0, at[u] = i, at[v] = j;
        crossed[node_of(g, at[0], at[1], at[2])] ^= 1;
      }
  }
  int64_t runs = a == 2 ? g->size[0] * g->size[1] : a == 1 ? g->size[0] : 1;  /* a line along z, or a plane, or all */
  int64_t step = a == 2 ? 1 : a == 1 ? g->size[2] : g->size[1] * g->size[2], length = step * g->size[a];
  for (int64_t run = 0; run < runs; run++) {
    uint8_t *row = crossed + run * length, *vote = votes + run * length;
    for (int64_t n = step; n < length; n++) row[n] ^= row[n - step];
    for (int64_t n = 0; n < length; n++) vote[n] += row[n];
  }
}

/* Fill a grid's values; returns 0, or 1 where there is no memory, and how many nodes' rays disagree. */
EXPORT int skillframe_values(const Grid* g, const Mesh* mesh, float* value, int64_t* disagree) {
  int64_t total = g->size[0] * g->size[1] * g->size[2];
  uint8_t* votes = calloc((size_t)total, 2);
  if (!votes) return 1;
  for (int64_t node = 0; node < total; node++) value[node] = FAR;
  for (int64_t t = 0; t < mesh->count; t++) near_triangle(g, mesh, t, BAND * g->cell, 0.0, lower, value);
  spread(g, value);
  for (int a = 0; a < 3; a++) cast(g, mesh, a, votes + total, votes);
  *disagree = 0;
  for (int64_t node = 0; node < total; node++) {
    if (votes[node] > 1) value[node] = -value[node];
    *disagree += votes[node] == 1 || votes[node] == 2;
  }
  free(votes);
  return 0;
}

/* Mark the cells near the surface in which distance is no linear function within a tolerance; returns how many. */
EXPORT int64_t skillframe_mark(const Grid* g, double tolerance, uint64_t* listed) {
  int64_t found = 0;
  for (int64_t i = 0; i + 1 < g->size[0]; i++)
    for (int64_t j = 0; j + 1 < g->size[1]; j++)
      for (int64_t k = 0; k + 1 < g->size[2]; k++) {
        double v[8], mean = 0, slope[3] = {0, 0, 0}, low = FAR, high = -FAR, off = 0;
        for (int c = 0; c < 8; c++) {
          v[c] = g->value[node_of(g, i + (c >> 2), j + (c >> 1 & 1), k + (c & 1))];
          low = smaller(low, v[c]), high = larger(high, v[c]);
        }
        if (low > g->cell || high < -2 * g->cell) continue;
        for (int c = 0; c < 8; c++) {
          mean += v[c] / 8;
          for (int x = 0; x < 3; x++) slope[x] += (c >> (2 - x) & 1 ? 0.25 : -0.25) * v[c];
        }
        for (int c = 0; c < 8; c++) {
          double plane = mean;
          for (int x = 0; x < 3; x++) plane += (c >> (2 - x) & 1 ? 0.5 : -0.5) * slope[x];
          off = larger(off, fabs(v[c] - plane));
        }
        if (off <= tolerance && fabs(sqrt(dot(slope, slope)) - g->cell) <= 4 * tolerance) continue;
        int64_t node = node_of(g, i, j, k);
        listed[node >> 6] |= (uint64_t)1 << (node & 63);
        found++;
      }
  return found;
}

/* Gaps of all cells, from values and marks (see Grid and CLEAR).

   Of a cell without a list what is seen is between its corners' values. In one with a list it is exact, and no point is
   farther than 0.87 cells from a corner. Values beyond the band are at most `LOOSE` too large. */
EXPORT void skillframe_gaps(const Grid* g, uint8_t* gap) {
  int64_t sx = g->size[1] * g->size[2], sy = g->size[2];
  memset(gap, 0, (size_t)(g->size[0] * sx));
  for (int64_t i = 0; i + 1 < g->size[0]; i++)
    for (int64_t j = 0; j + 1 < g->size[1]; j++)
      for (int64_t k = 0; k + 1 < g->size[2]; k++) {
        int64_t node = node_of(g, i, j, k);
        const float* v = g->value + node;
        const float* corner[4] = {v, v + sy, v + sx, v + sx + sy};
        float low = v[0];
        for (int c = 0; c < 4; c++)
          for (int z = 0; z < 2; z++) low = corner[c][z] < low ? corner[c][z] : low;
        double cells = (double)low / g->cell;
        int listed = (int)(g->listed[node >> 6] >> (node & 63) & 1);
        if (listed ? cells > 0.87 : cells >= 0)
          gap[node] = (uint8_t)(1 + smaller(254, larger(0, (double)below((cells / LOOSE - 1.8) / CLEAR))));
      }
}

typedef struct {
  int32_t rank, triangle;
} Listed;

typedef struct {
  const Grid* grid;
  float* nearest;
  int32_t* count;
  Listed* found;
  int64_t many, room;
} Lists;

static INLINE int64_t rank_of(const Grid* g, int64_t node) {
  uint64_t word = g->listed[node >> 6], bit = (uint64_t)1 << (node & 63);
  return word & bit ? (int64_t)g->before[node >> 6] + ones(word & (bit - 1)) : -1;
}

static INLINE void shorten(void* what, int64_t node, int64_t t, const double* corner, const double* place, double off) {
  Lists* lists = what;
  int64_t rank = rank_of(lists->grid, node);
  (void)t;
  if (rank < 0 || off > (double)lists->nearest[rank]) return;
  float away = (float)distance_to(corner, place);
  if (away < lists->nearest[rank]) lists->nearest[rank] = away;
}

static INLINE void enlist(void* what, int64_t node, int64_t t, const double* corner, const double* place, double off) {
  Lists* lists = what;
  int64_t rank = rank_of(lists->grid, node);
  if (rank < 0 || !lists->found) return;
  double most = (double)lists->nearest[rank] + 1.7321 * lists->grid->cell;
  if (off > most || distance_to(corner, place) > most) return;
  if (lists->many == lists->room) {
    Listed* more = realloc(lists->found, sizeof(Listed) * 2 * (size_t)lists->room);
    if (!more) free(lists->found);
    lists->found = more, lists->room *= 2;
    if (!more) return;
  }
  lists->found[lists->many].rank = (int32_t)rank, lists->found[lists->many++].triangle = (int32_t)t;
  lists->count[rank]++;
}

/* What is surely farther from each marked cell's centre than a triangle is: from the values at its corners. */
static void bound(const Grid* g, int64_t cells, float* nearest) {
  int64_t total = g->size[0] * g->size[1] * g->size[2];
  int64_t sx = g->size[1] * g->size[2], sy = g->size[2], corner[8] = {0, 1, sy, sy + 1, sx, sx + 1, sx + sy, sx + sy + 1};
  for (int64_t node = 0, rank = 0; node < total && rank < cells; node++) {
    if (!(g->listed[node >> 6] >> (node & 63) & 1)) continue;
    double least = FAR;
    for (int c = 0; c < 8; c++) least = smaller(least, fabs((double)g->value[node + corner[c]]));
    nearest[rank++] = (float)(1.0001 * (least + 0.8661 * g->cell));
  }
}

static double most_of(const float* values, int64_t count) {
  double most = 0;
  for (int64_t i = 0; i < count; i++) most = larger(most, values[i]);
  return most;
}

/* Find the lists of a grid's marked cells: how many there are in each, and all of them, by triangle; -1 without memory. */
EXPORT int64_t skillframe_lists(const Grid* g, const Mesh* mesh, int64_t cells, float* nearest, int32_t* count, Listed** found) {
  Lists lists = {g, nearest, count, malloc(sizeof(Listed) << 16), 0, 1 << 16};
  bound(g, cells, nearest);
  double reach = smaller(REACH * g->cell, most_of(nearest, cells));
  for (int64_t t = 0; t < mesh->count; t++) near_triangle(g, mesh, t, reach, 0.5, shorten, &lists);
  reach = smaller(REACH * g->cell, 1.0001 * (most_of(nearest, cells) + 1.7321 * g->cell));
  for (int64_t t = 0; t < mesh->count; t++) near_triangle(g, mesh, t, reach, 0.5, enlist, &lists);
  *found = lists.found;
  return lists.found ? lists.many : -1;
}

/* Put what was found into the list of its cell, from `start`, the lists' ends where the next goes, and forget it. */
EXPORT void skillframe_sort(int64_t many, Listed* found, int32_t* start, int32_t* triangle) {
  for (int64_t i = 0; i < many; i++) triangle[start[found[i].rank]++] = found[i].triangle;
  free(found);
}

/* How far a point is from a box along the axis in which that is most; 0 inside. No triangle in the box is nearer. */
static INLINE double outside(const double* box, const double* p) {
  double away = 0;
  for (int x = 0; x < 3; x++) away = larger(away, larger(box[x] - p[x], p[x] - box[3 + x]));
  return away;
}

/* Exact signed distances of points (count, 3) from a closed mesh; returns 1 where there is no memory.

   Boxes are those of one triangle, of `RUN` that follow each other, and of `RUN` such runs. */
EXPORT int skillframe_exact(const Mesh* mesh, int64_t count, const double* point, double* out) {
  int64_t total = mesh->count, runs = (total + RUN - 1) / RUN, wide = (runs + RUN - 1) / RUN;
  double* box = malloc(sizeof(double) * 6 * (size_t)(total + runs + wide + 1));
  if (!box) return 1;
  double *of_run = box + 6 * total, *of_wide = of_run + 6 * runs;
  for (int64_t n = 0; n < 6 * (total + runs + wide); n++) box[n] = n % 6 < 3 ? FAR : -FAR;
  for (int64_t t = 0; t < total; t++) {
    widen(mesh->corner + 9 * t, 1, box + 6 * t);
    widen(mesh->corner + 9 * t, 1, of_run + 6 * (t / RUN));
    widen(mesh->corner + 9 * t, 1, of_wide + 6 * (t / RUN / RUN));
  }
  for (int64_t i = 0; i < count; i++) {
    const double* p = point + 3 * i;
    double best = FAR, c[3], d[3];
    for (int64_t w = 0; w < wide; w++) {
      if (outside(of_wide + 6 * w, p) >= best) continue;
      for (int64_t r = RUN * w; r < RUN * (w + 1) && r < runs; r++) {
        if (outside(of_run + 6 * r, p) >= best) continue;
        for (int64_t t = RUN * r; t < RUN * (r + 1) && t < total; t++) {
          if (outside(box + 6 * t, p) >= best) continue;
          int feature = nearest_on(mesh->corner + 9 * t, p, c);
          for (int x = 0; x < 3; x++) d[x] = p[x] - c[x];
          double size = sqrt(dot(d, d));
          if (size < best) best = size, out[i] = dot(d, mesh->normal + 21 * t + 3 * feature) < 0 ? -size : size;
        }
      }
    }
  }
  free(box);
  return 0;
}
