"""Where each sensor unit sits on its link, found from what its IMU measures while the arm moves."""
