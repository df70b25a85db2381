// add_records
