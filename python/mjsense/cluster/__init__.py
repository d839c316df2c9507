# SPDX-License-Identifier: Apache-2.0
"""Recording on many machines with Ray: a job is divided into shards, ranges of attempts, each of which any worker can record
alone."""

from mjsense.cluster.driver import ClusterProgress, ClusterSummary, record_on_ray
from mjsense.cluster.exporting import export_on_ray
from mjsense.cluster.job import Job
from mjsense.cluster.rendering import render_on_ray

__all__ = ["ClusterProgress", "ClusterSummary", "Job", "export_on_ray", "record_on_ray", "render_on_ray"]
