// irradiance_sum/workgroup_tree
