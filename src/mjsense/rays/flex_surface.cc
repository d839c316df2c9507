// SPDX-License-Identifier: Apache-2.0
#include "mjsense/rays/flex_surface.h"

#include <algorithm>

namespace mjsense::rays {
namespace {

// The first element of each material among the elements of flex f. MuJoCo draws all of a flex of
// dimension 1 in the material of its first element.
std::vector<int> first_elements(const mjModel* m, int f) {
  std::vector<int> firsts;
  const int begin = m->flex_elemadr[f];
  const int end =
      begin + (m->flex_dim[f] == 1 ? std::min(m->flex_elemnum[f], 1) : m->flex_elemnum[f]);
  for (int e = begin; e < end; ++e)
    if (std::none_of(firsts.begin(), firsts.end(),
                     [&](int first) { return m->flex_matid[first] == m->flex_matid[e]; }))
      firsts.push_back(e);
  return firsts;
}

// Returns the element of flex f that contains all of these vertices.
int element_with(const mjModel* m, int f, const int* vertices, int count) {
  const int corners = m->flex_dim[f] + 1;
  const int* v = m->flex_elem + m->flex_elemdataadr[f];
  for (int e = 0; e < m->flex_elemnum[f]; ++e, v += corners)
    if (std::all_of(vertices, vertices + count,
                    [&](int x) { return std::find(v, v + corners, x) != v + corners; }))
      return m->flex_elemadr[f] + e;
  return m->flex_elemadr[f];
}

// Reorders rows of three values.
void reorder(std::vector<int>& values, const std::vector<int>& order) {
  if (values.empty()) return;
  std::vector<int> sorted;
  for (int row : order) sorted.insert(sorted.end(), &values[3 * row], &values[3 * row] + 3);
  values = std::move(sorted);
}

// Makes the faces of each material in `firsts` contiguous. `elements`: the element of each face.
void divide(const mjModel* m, const std::vector<int>& firsts, const std::vector<int>& elements,
            FlexSurface& s) {
  std::vector<int> order;
  for (int first : firsts) {
    const std::size_t before = order.size();
    for (std::size_t row = 0; row < elements.size(); ++row)
      if (m->flex_matid[elements[row]] == m->flex_matid[first])
        order.push_back(static_cast<int>(row));
    s.parts.push_back({first, static_cast<int>(before), static_cast<int>(order.size() - before)});
  }
  reorder(s.faces, order);
  reorder(s.texcoords, order);
}

}  // namespace

FlexSurface flex_surface(const mjModel* m, int f) {
  FlexSurface s;
  s.dim = m->flex_dim[f];
  s.num_vertices = m->flex_vertnum[f];
  s.flat = m->flex_flatskin[f];
  const double* unit = m->flex_vert0 + 3 * m->flex_vertadr[f];
  for (int i = 0; i < 3 * s.num_vertices; ++i)
    s.rest.push_back(static_cast<float>(2 * m->flex_size[3 * f + i % 3] * unit[i]));

  const int n = s.num_vertices;
  const int first_element = m->flex_elemadr[f];
  const int* vertices = m->flex_elem + m->flex_elemdataadr[f];
  const int* element_texcoords = m->flex_elemtexcoord + m->flex_elemdataadr[f];
  const int* shell = m->flex_shell + m->flex_shelldataadr[f];
  const bool textured = m->flex_texcoordadr[f] >= 0;
  const std::vector<int> firsts = first_elements(m, f);
  std::vector<int> elements;  // of each face
  const auto face = [&](int a, int b, int c) { s.faces.insert(s.faces.end(), {a, b, c}); };
  const auto texcoord = [&](int a, int b, int c) {
    if (textured) s.texcoords.insert(s.texcoords.end(), {a, b, c});
  };
  if (s.dim == 1) s.edges.assign(vertices, vertices + 2 * m->flex_elemnum[f]);
  for (int e = 0; e < m->flex_elemnum[f] && s.dim == 2; ++e) {
    const int *v = vertices + 3 * e, *t = element_texcoords + 3 * e;
    face(v[0], v[1], v[2]);
    texcoord(t[0], t[1], t[2]);
    face(n + v[0], n + v[2], n + v[1]);
    texcoord(t[0], t[2], t[1]);
    elements.insert(elements.end(), 2, first_element + e);
  }
  for (int i = 0; i < m->flex_shellnum[f] && s.dim > 1; ++i) {
    const int* v = shell + s.dim * i;
    const int element = firsts.size() > 1 ? element_with(m, f, v, s.dim) : first_element;
    if (s.dim == 2) {
      face(v[0], n + v[1], v[1]);
      texcoord(v[0], v[1], v[1]);
      face(n + v[1], v[0], n + v[0]);
      texcoord(v[1], v[0], v[0]);
      elements.insert(elements.end(), 2, element);
    } else {
      face(v[0], v[1], v[2]);
      texcoord(v[0], v[1], v[2]);
      elements.push_back(element);
    }
  }
  divide(m, firsts, elements, s);
  return s;
}

std::vector<FlexPart> flex_parts(const mjModel* m) {
  std::vector<FlexPart> parts;
  for (int f = 0; f < m->nflex; ++f)
    for (int element : first_elements(m, f)) parts.push_back({f, element});
  return parts;
}

}  // namespace mjsense::rays
