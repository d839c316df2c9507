// SPDX-License-Identifier: Apache-2.0
// Replaces OMPL's PlannerData, which exports the trees of a planner, because it depends on Boost.Serialization. Planners refer to
// these functions, but mjsense never exports trees.
#include <ompl/base/PlannerData.h>

#include <cstdlib>

namespace ompl::base {

unsigned int PlannerData::addStartVertex(const PlannerDataVertex&) { std::abort(); }
unsigned int PlannerData::addGoalVertex(const PlannerDataVertex&) { std::abort(); }
bool PlannerData::addEdge(const PlannerDataVertex&, const PlannerDataVertex&,
                          const PlannerDataEdge&, Cost) {
  std::abort();
}
bool PlannerData::addEdge(unsigned int, unsigned int, const PlannerDataEdge&, Cost) {
  std::abort();
}
unsigned int PlannerData::vertexIndex(const PlannerDataVertex&) const { std::abort(); }

}  // namespace ompl::base
