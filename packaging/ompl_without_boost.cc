// SPDX-License-Identifier: Apache-2.0
// What an OMPL planner writes when it is asked for its trees. OMPL's own brings Boost's serialization; nobody asks.
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
