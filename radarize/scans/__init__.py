"""Range scans from radar frames: by heat maps (`extraction`) or by the segmentation network (`segmentation`)."""
