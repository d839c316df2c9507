#include "mjsense/rays/flex_surface.h"

namespace mjsense {

FlexSurface flex_surface(const mjModel* m, int f) {
  FlexSurface s;
  s.dim = m->flex_dim[f];
  s.num_vertices = m->flex_vertnum[f];
  s.flat = m->flex_flatskin[f];
  const double* unit = m->flex_vert0 + 3 * m->flex_vertadr[f];
  for (int i = 0; i < 3 * s.num_vertices; ++i)
    s.rest.push_back(static_cast<float>(2 * m->flex_size[3 * f + i % 3] * unit[i]));

  const int n = s.num_vertices;
  const int* elements = m->flex_elem + m->flex_elemdataadr[f];
  const int* element_texcoords = m->flex_elemtexcoord + m->flex_elemdataadr[f];
  const int* shell = m->flex_shell + m->flex_shelldataadr[f];
  const bool textured = m->flex_texcoordadr[f] >= 0;
  const auto face = [&](int a, int b, int c) { s.faces.insert(s.faces.end(), {a, b, c}); };
  const auto texcoord = [&](int a, int b, int c) {
    if (textured) s.texcoords.insert(s.texcoords.end(), {a, b, c});
  };
  switch (s.dim) {
    case 1:
      s.edges.assign(elements, elements + 2 * m->flex_elemnum[f]);
      break;
    case 2:
      for (int e = 0; e < m->flex_elemnum[f]; ++e) {
        const int *v = elements + 3 * e, *t = element_texcoords + 3 * e;
        face(v[0], v[1], v[2]);
        texcoord(t[0], t[1], t[2]);
        face(n + v[0], n + v[2], n + v[1]);
        texcoord(t[0], t[2], t[1]);
      }
      s.num_sheet_faces = s.num_faces();
      for (int e = 0; e < m->flex_shellnum[f]; ++e) {
        const int a = shell[2 * e], b = shell[2 * e + 1];
        face(a, n + b, b);
        texcoord(a, b, b);
        face(n + b, a, n + a);
        texcoord(b, a, a);
      }
      break;
    default:
      for (int e = 0; e < m->flex_shellnum[f]; ++e) {
        const int* v = shell + 3 * e;
        face(v[0], v[1], v[2]);
        texcoord(v[0], v[1], v[2]);
      }
      s.num_sheet_faces = s.num_faces();
      break;
  }
  return s;
}

int flex_material(const mjModel* m, int f) {
  return m->flex_elemnum[f] > 0 ? m->flex_matid[m->flex_elemadr[f]] : -1;
}

}  // namespace mjsense
