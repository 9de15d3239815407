/* A part's surface for contact: its triangles, grids of signed distance, and points. Lengths in metres. */
#ifndef SKILLFRAME_SURFACES_H
#define SKILLFRAME_SURFACES_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#define EXPORT __attribute__((visibility("default")))
#define INLINE inline __attribute__((always_inline))
#define LOOSE 1.15 /* distances beyond the band are at most this much too large */
#define CLEAR 0.25 /* cells; a gap of 1 + n says that every point within n of these is outside */

typedef struct {
  int64_t count;         /* triangles */
  const double* corner;  /* (count, 3, 3) */
  const double* normal;  /* (count, 7, 3): of the face, of edges ab, bc, ca, of corners a, b, c; unit length */
} Mesh;

typedef struct {
  double origin[3], cell;
  int64_t size[3];          /* nodes; x runs slowest */
  const float* value;       /* signed distance at the nodes, negative inside */
  const uint8_t* gap;       /* of the cell that begins there: 0 where a point may be inside, else see CLEAR */
  const uint64_t* listed;   /* one bit a node: the cell that begins there has a list of triangles */
  const uint32_t* before;   /* listed cells before each word of 64 */
  const int32_t* start;     /* (listed cells + 1) into `triangle` */
  const int32_t* triangle;  /* those that can be nearest within a cell */
} Grid;

typedef struct {
  Mesh mesh;
  Grid grid[2];             /* fine, where the parts can meet, and coarse, all of it; a size of zero: not there */
  double turn[9], shift[3]; /* part frame to body frame */
  double apart;             /* least distance of two contacts */
  int64_t agrees;           /* see skillframe_agrees */
  int64_t points, blocks, groups;
  const double* point;      /* (points, 3), block by block */
  const double* ball;       /* (blocks, 4): centre and radius */
  const int64_t* first;     /* (blocks + 1) into `point` */
  const double* around;     /* (groups, 4): centre and radius of some blocks that follow each other */
  const int64_t* group;     /* (groups + 1) into `ball` */
} Part;

static inline double dot(const double* a, const double* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static inline double larger(double a, double b) { return a > b ? a : b; }

static inline double smaller(double a, double b) { return a < b ? a : b; }

/* The largest whole number that is not above x, which is held to what one has room for. */
static inline int64_t below(double x) {
  if (!(x > -1e15)) return -1000000000000000;
  if (x > 1e15) return 1000000000000000;
  int64_t whole = (int64_t)x;
  return whole - ((double)whole > x);
}

/* How many bits are set, without the instruction for it, which not every processor has. */
static inline int ones(uint64_t word) {
  word -= word >> 1 & 0x5555555555555555u;
  word = (word & 0x3333333333333333u) + (word >> 2 & 0x3333333333333333u);
  return (int)(((word + (word >> 4)) & 0x0f0f0f0f0f0f0f0fu) * 0x0101010101010101u >> 56);
}

static inline int64_t node_of(const Grid* g, int64_t i, int64_t j, int64_t k) {
  return (i * g->size[1] + j) * g->size[2] + k;
}

/* The point c of a triangle that is nearest to p; says which of its seven features (see Mesh) that is.
   C. Ericson, Real-Time Collision Detection, 2005, section 5.1.5. */
static inline int nearest_on(const double* t, const double* p, double* c) {
  double ab[3], ac[3], ap[3], bp[3], cp[3];
  for (int x = 0; x < 3; x++) {
    ab[x] = t[3 + x] - t[x];
    ac[x] = t[6 + x] - t[x];
    ap[x] = p[x] - t[x];
    bp[x] = p[x] - t[3 + x];
    cp[x] = p[x] - t[6 + x];
  }
  double d1 = dot(ab, ap), d2 = dot(ac, ap), d3 = dot(ab, bp), d4 = dot(ac, bp), d5 = dot(ab, cp), d6 = dot(ac, cp);
  double v, w;
  int feature;
  double va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
  if (d1 <= 0 && d2 <= 0) v = 0, w = 0, feature = 4;
  else if (d3 >= 0 && d4 <= d3) v = 1, w = 0, feature = 5;
  else if (d6 >= 0 && d5 <= d6) v = 0, w = 1, feature = 6;
  else if (vc <= 0 && d1 >= 0 && d3 <= 0) v = d1 / (d1 - d3), w = 0, feature = 1;
  else if (vb <= 0 && d2 >= 0 && d6 <= 0) v = 0, w = d2 / (d2 - d6), feature = 3;
  else if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0)
    w = (d4 - d3) / ((d4 - d3) + (d5 - d6)), v = 1 - w, feature = 2;
  else v = vb / (va + vb + vc), w = vc / (va + vb + vc), feature = 0;
  for (int x = 0; x < 3; x++) c[x] = t[x] + v * ab[x] + w * ac[x];
  return feature;
}

static inline double distance_to(const double* t, const double* p) {
  double c[3], d[3];
  nearest_on(t, p, c);
  for (int x = 0; x < 3; x++) d[x] = p[x] - c[x];
  return sqrt(dot(d, d));
}

#endif
