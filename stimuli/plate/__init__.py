"""One model of the plate: functions across give its waves, products with those along its modes."""
