"""`radarize benchmark real`: methods on RadarHD's real walks."""
