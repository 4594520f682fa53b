"""Odometry from scans alone, whatever they are made with."""

from radarize.methods.method import Method

ODOMETRY = {"scan-matching": Method("scan matching", "radarize.methods.scan_matching.odometry:odometry", scans=True)}
