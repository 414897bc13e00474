!> Rules of a scene as a whole: each broken one is found and its message has a place.
module test_scene_content_check
  use pd_base_kinds, only: wp
  use pd_base_error, only: scene_error => error_type
  use pd_scene_content_check, only: check_scene
  use pd_scene_content_types, only: scene_type
  use test_scene_expect, only: expect_fault, expect_parts, expect_scene, good_head, line
  use testdrive, only: check, error_type, new_unittest, unittest_type
  implicit none (type, external)
  private
  public :: collect_scene_content_check

  character(*), parameter :: scene_2d = '&scene dimension = 2 /'//line
  character(*), parameter :: scene_3d = '&scene dimension = 3 /'//line
  character(*), parameter :: soft = '&material youngs_modulus = 1 density = 1 poissons_ratio = '// &
    & '0.2 /'//line
  character(*), parameter :: square = '&body lower = 0 0 upper = 1 1 points = 9 9 /'//line
  character(*), parameter :: cube = '&body lower = 0 0 0 upper = 1 1 1 points = 4 4 4 /'//line
  character(*), parameter :: go = '&time steps = 1 /'//line
  character(*), parameter :: base = scene_2d//soft//square//go   !! four lines

contains

  subroutine collect_scene_content_check(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('groups that must be there', test_needed), &
      & new_unittest('alternatives exclude each other', test_alternatives), &
      & new_unittest('time needs an end', test_time), &
      & new_unittest('lattices', test_lattices), &
      & new_unittest('equal spacing', test_spacing), &
      & new_unittest('counts that are proposed are accepted', test_proposed), &
      & new_unittest('names that must exist', test_references), &
      & new_unittest('names that must differ', test_unique), &
      & new_unittest('bond laws and their keys', test_laws), &
      & new_unittest('the bond-based ratio', test_bond_based), &
      & new_unittest('the range of the ratio', test_ratio), &
      & new_unittest('shapes', test_shapes), &
      & new_unittest('cracks', test_cracks), &
      & new_unittest('initial states', test_initial), &
      & new_unittest('boundaries', test_boundaries), &
      & new_unittest('loads', test_loads), &
      & new_unittest('courses in time', test_courses), &
      & new_unittest('clouds', test_clouds), &
      & new_unittest('probes', test_probes), &
      & new_unittest('defaults are filled in', test_filled), &
      & new_unittest('a scene built in memory', test_memory)]
  end subroutine collect_scene_content_check

  subroutine test_needed(error)
    type(error_type), allocatable, intent(out) :: error
    call expect_fault(error, soft, "&scene lacks the key 'dimension'|a/b.nml")
    call expect_fault(error, scene_2d//square//go, 'no group &material|a/b.nml')
    call expect_fault(error, scene_2d//soft//go, 'no group &body|a/b.nml')
    call expect_fault(error, scene_2d//'&material youngs_modulus = 1 poissons_ratio = 0 /'// &
      & line//square//go, "&material lacks the key 'density'|a/b.nml:2")
    call expect_fault(error, scene_2d//'&material youngs_modulus = 1 density = 1 /'//line// &
      & square//go, "&material lacks the key 'poissons_ratio'|a/b.nml:2|plane stress")
  end subroutine test_needed

  subroutine test_alternatives(error)
    type(error_type), allocatable, intent(out) :: error
    call expect_fault(error, base//'&horizon ratio = 3'//line//' length = 1 /', &
      & "'ratio' and 'length' are both given|a/b.nml:6|^^^^^^")
    call expect_fault(error, base//'&output every = 3 interval = 1 /', &
      & "'every' and 'interval' are both given|a/b.nml:5")
    call expect_fault(error, scene_2d//soft//square//'&time steps = 1 step = 1 safety = 0.5 /', &
      & "'step' and 'safety' are both given|a/b.nml:4")
    call expect_fault(error, scene_2d//square//go//'&material youngs_modulus = 1 density = 1 '// &
      & 'poissons_ratio = 0 critical_stretch = 1 critical_energy_release_rate = 1 /', &
      & "'critical_stretch' and 'critical_energy_release_rate' are both given|a/b.nml:4")
  end subroutine test_alternatives

  subroutine test_time(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    call expect_fault(error, scene_2d//soft//square, "&time lacks the key 'steps' or 'duration'")
    call expect_fault(error, scene_2d//soft//square//'&time step = 1 /', &
      & "&time lacks the key 'steps' or 'duration'|a/b.nml:4")
    call expect_fault(error, scene_2d//soft//square//'&time steps = 1'//line//'duration = 1 /', &
      & "'steps' and 'duration' are both given|a/b.nml:5")
    call expect_scene(error, scene_2d//soft//square//"&time method = 'relaxation' /", scene)
  end subroutine test_time

  subroutine test_lattices(error)
    type(error_type), allocatable, intent(out) :: error
    call expect_fault(error, scene_2d//soft//go//'&body /', 'a body without points|a/b.nml:4')
    call expect_fault(error, scene_2d//soft//go//'&body upper = 1 1 points = 1 1 /', &
      & "&body lacks the key 'lower'|a/b.nml:4")
    call expect_fault(error, scene_2d//soft//go//'&body lower = 0 0 points = 1 1'//line// &
      & 'upper = 1 /', "'upper' has too few values|a/b.nml:5|2 values")
    call expect_fault(error, scene_2d//soft//go//'&body lower = 0 0 2 upper = 1 1 points = 1 1 /', &
      & "'lower' has too many values|2 values")
    call expect_fault(error, scene_2d//soft//go//'&body lower = 0 1 upper = 1 1 points = 1 1 /', &
      & "'upper' is not above 'lower' along y|a/b.nml:4")
    call expect_fault(error, scene_2d//soft//go//'&body lower = 0 0 upper = 1 1 points = 3 /', &
      & "'points' needs 2 counts|a/b.nml:4")
    call expect_fault(error, scene_2d//soft//go//'&body lower = 0 0 upper = 1 1 points = 3 3 3 /', &
      & "'points' needs 2 counts")
    call expect_fault(error, scene_2d//soft//go//'&body lower = 0 0 upper = 1 1'//line// &
      & 'points = 50000 50000 /', 'too many points: 2.5e9|a/b.nml:5|at most 1e9')
  end subroutine test_lattices

  subroutine test_spacing(error)
    type(error_type), allocatable, intent(out) :: error
    call expect_fault(error, scene_2d//soft//go//'&body lower = 0 0 upper = 1 0.5'//line// &
      & ' points = 100 40 /', 'spacing of the lattice differs|a/b.nml:5|100, 50 or 80, 40|0.0125 m')
    call expect_fault(error, scene_2d//soft//go//'&body lower = 0 0 upper = 0.3 0.2 points = '// &
      & '100 40 /', 'spacing of the lattice differs|points = 60, 40')
    call expect_fault(error, scene_2d//soft//go//'&body lower = 0 0 upper = 1 0.512345678 '// &
      & 'points = 10 10 /', 'spacing of the lattice differs|no counts near these')
    call expect_fault(error, scene_2d//soft//go//'&body lower = 0 0 upper = 1 0.500001 '// &
      & 'points = 100 50 /', 'spacing of the lattice differs')
  end subroutine test_spacing

  subroutine test_proposed(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    call expect_scene(error, scene_2d//soft//go//'&body lower = 0 0 upper = 0.3 0.2 points = '// &
      & '60 40 /', scene)
    call expect_scene(error, scene_2d//soft//go//'&body lower = 0 0 upper = 1 0.5000001 '// &
      & 'points = 100 50 /', scene)
  end subroutine test_proposed

  subroutine test_references(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: two = "&material name = 'steel' youngs_modulus = 1 density = 1 "// &
      & "poissons_ratio = 0 /&material name = 'glass' youngs_modulus = 1 density = 1 "// &
      & 'poissons_ratio = 0 /'//line
    call expect_fault(error, scene_2d//two//square//go, &
      & "&body lacks the key 'material'|a/b.nml:3|2 materials")
    call expect_fault(error, scene_2d//two//"&body material = 'steal' lower = 0 0 upper = 1 1 "// &
      & 'points = 9 9 /'//line//go, "no material is named 'steal'|a/b.nml:3|did you mean "// &
      & "'steel'?|known: steel, glass")
    call expect_fault(error, good_head//go//"&boundary side = 'x_min' body = 'plata' "// &
      & 'displacement_x = 0 /', "no body is named 'plata'|did you mean 'plate'?|a/b.nml:5")
    call expect_fault(error, base//"&boundary side = 'x_min' body = 'plata' displacement_x = 0 /", &
      & "no body is named 'plata'|no body has a name")
    call expect_fault(error, base//"&region name = 'left' shape = 'box' lower = 0 /"//line// &
      & "&initial region = 'lift' velocity_x = 1 /", "no region is named 'lift'|a/b.nml:6|'left'")
    call expect_fault(error, base//"&no_fail region = 'r' /", "no region is named 'r'|a/b.nml:5")
    call expect_fault(error, base//"&load region = 'r' force_x = 1 /", "no region is named 'r'")
  end subroutine test_references

  subroutine test_unique(error)
    type(error_type), allocatable, intent(out) :: error
    call expect_fault(error, good_head//go//"&body name = 'plate' lower = 2 0 upper = 3 1 "// &
      & 'points = 100 100 /', "the name 'plate' is used by another &body|a/b.nml:5")
    call expect_fault(error, base//"&probe name = 'p' point = 0 0 /"//line// &
      & "&probe name = 'p' point = 0 1 /", "the name 'p' is used by another &probe|a/b.nml:6")
    call expect_fault(error, base//"&region name = 'p' shape = 'box' lower = 0 /"//line// &
      & "&region name = 'p' shape = 'box' lower = 0 /", "the name 'p'|&region|a/b.nml:6")
  end subroutine test_unique

  !> Bond laws by their names, and keys that belong to some of them.
  subroutine test_laws(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: start = '&material youngs_modulus = 1 density = 1 '// &
      & 'poissons_ratio = 0.25'//line

    call expect_fault(error, scene_3d//start//"model = 'state_basd' /"//cube//go, &
      & "unknown value 'state_basd' of key 'model'|did you mean 'state_based'?|"// &
      & 'allowed: state_based, bond_based, lps|a/b.nml:3')
    call expect_fault(error, scene_3d//start//'yield_stress = 1 /'//cube//go, &
      & "'yield_stress' is no key of model = 'state_based'|model = 'lps_plastic'|a/b.nml:3")
    call expect_fault(error, scene_3d//start//"model = 'lps_plastic' /"//cube//go, &
      & "&material lacks the key 'yield_stress'|[Pa]|a/b.nml:2")
    call expect_fault(error, scene_3d//start//'scatter = 5 /'//cube//go, &
      & "'scatter' without a strength|critical_stretch|a/b.nml:3")
    call expect_fault(error, scene_3d//start//"model = 'softening' peak_stretch = 1e-3 "// &
      & 'critical_stretch = 1e-2 scatter = 5 /'//cube//go, "model = 'softening' has no 'scatter'")
  end subroutine test_laws

  subroutine test_bond_based(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: bonds = &
      & "&material model = 'bond_based' youngs_modulus = 1 density = 1 "
    type(scene_type) :: scene

    call expect_fault(error, scene_2d//bonds//line//'poissons_ratio = 0.25 /'//line//square//go, &
      & "cannot have Poisson's ratio 0.25|a/b.nml:3|plane stress it has 1/3|state_based")
    call expect_fault(error, "&scene dimension = 2 plane = 'strain' /"//bonds// &
      & 'poissons_ratio = 0.333 /'//square//go, 'plane strain it has 1/4')
    call expect_fault(error, scene_3d//bonds//'poissons_ratio = 0.3 /'//cube//go, &
      & 'in 3D it has 1/4')
    call expect_scene(error, scene_3d//bonds//'poissons_ratio = 0.25 /'//cube//go, scene)
    call expect_scene(error, '&scene dimension = 1 /'//bonds//'poissons_ratio = 0.1 /'// &
      & '&body lower = 0 upper = 1 points = 3 /'//go, scene)
    call expect_scene(error, scene_2d//bonds//'poissons_ratio = 0.1 ignore_poissons_ratio = t /'// &
      & square//go, scene)
    if (allocated(error)) return
    call check(error, scene%materials(1)%poissons_ratio, 1.0_wp/3.0_wp)
    if (allocated(error)) return
    call expect_scene(error, scene_2d//bonds//'poissons_ratio = 0.333 /'//square//go, scene)
    if (allocated(error)) return
    call check(error, scene%materials(1)%poissons_ratio, 1.0_wp/3.0_wp)
  end subroutine test_bond_based

  subroutine test_ratio(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: rubber = &
      & '&material youngs_modulus = 1 density = 1 poissons_ratio = 0.6 /'//line
    type(scene_type) :: scene

    call expect_scene(error, scene_2d//rubber//square//go, scene)
    call expect_fault(error, scene_3d//rubber//cube//go, &
      & "'poissons_ratio' is out of range|a/b.nml:2")
    call expect_fault(error, "&scene dimension = 2 plane = 'strain' /"//rubber//square//go, &
      & "'poissons_ratio' is out of range|plane strain")
    call expect_fault(error, '&material poissons_ratio = -1 /', "'poissons_ratio' is out of range")
  end subroutine test_ratio

  subroutine test_shapes(error)
    type(error_type), allocatable, intent(out) :: error
    call expect_fault(error, base//"&remove shape = 'box' /", 'a box without bounds|a/b.nml:5')
    call expect_fault(error, base//"&remove shape = 'sphere' /", "without the key 'radius'")
    call expect_fault(error, base//"&remove shape = 'cylinder' /", "without the key 'radius'")
    call expect_fault(error, base//"&remove shape = 'box' lower = 0 radius = 1 /", &
      & "'radius' is no key of a box")
    call expect_fault(error, base//"&remove shape = 'sphere' radius = 1 lower = 0 /", &
      & "'lower' is no key of a sphere")
    call expect_fault(error, base//"&remove shape = 'box' lower = 0 2 upper = 1 1 /", &
      & "'upper' is not above 'lower' along y")
    call expect_fault(error, base//'&no_fail /', "'region' or 'shape'|a/b.nml:5")
    call expect_fault(error, base//"&region name = 'r' shape = 'box' lower = 0 /&no_fail "// &
      & "region = 'r' shape = 'box' lower = 0 /", "'region' and 'shape' are both given")
  end subroutine test_shapes

  subroutine test_cracks(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    character(*), parameter :: base_3d = scene_3d//soft//cube//go

    call expect_fault(error, base//'&crack centre = 0 0 normal = 1 0 radius = 1 /', &
      & 'not a crack of dimension 2|a/b.nml:5|segment')
    call expect_fault(error, base_3d//'&crack from = 0 0 to = 1 1 /', &
      & 'not a crack of dimension 3|parallelogram|disc')
    call expect_fault(error, base//'&crack /', 'not a crack of dimension 2')
    call expect_fault(error, base//'&crack from = 0 0 /', "&crack lacks the key 'to'")
    call expect_fault(error, base//'&crack from = 0 0 to = 0 0 /', 'a crack without length')
    call expect_fault(error, base_3d//'&crack corner = 3*0 edge_1 = 1 0 0 edge_2 = 2 0 0 /', &
      & 'a crack without area')
    call expect_fault(error, base_3d//'&crack centre = 3*0 normal = 3*0 radius = 1 /', 'is zero')
    call expect_fault(error, base_3d//'&crack centre = 3*0 normal = 1 0 0 /', "'radius'")
    call expect_fault(error, base_3d//'&crack centre = 3*0 normal = 1 0 0 radius = 1 to = 3*0 /', &
      & 'not a crack of dimension 3')
    call expect_fault(error, '&scene dimension = 1 /'//soft// &
      & '&body lower = 0 upper = 1 points = 3 /'//go//'&crack from = 0 to = 1 /', &
      & 'a crack in a scene of dimension 1')
    call expect_scene(error, base_3d//'&crack corner = 3*0 edge_1 = 1 0 0 edge_2 = 0 1 0 /'// &
      & '&crack centre = 3*0 normal = 1 0 0 radius = 1 /', scene)
    call expect_fault(error, base//'&crack points = 0 0 1 /'//line, &
      & "'points' has 3 values|a/b.nml:5")
    call expect_fault(error, base//'&crack points = 0 0 0.5 0.5 0.5 0.5 /'//line, &
      & 'points 2 and 3 are the same|a/b.nml:5')
    call expect_fault(error, base//'&crack points = 0 0 1 1 from = 0 0 to = 1 0 /'//line, &
      & 'another kind of crack|a/b.nml:5')
    call expect_fault(error, scene_3d//soft//cube//go//'&crack points = 0 0 1 1 /'//line, &
      & 'a chain of segments in a scene of dimension 3|a/b.nml:5')
  end subroutine test_cracks

  subroutine test_initial(error)
    type(error_type), allocatable, intent(out) :: error
    call expect_fault(error, base//'&initial /', '&initial is empty|a/b.nml:5')
    call expect_fault(error, base//'&initial velocity_z = 1 /', &
      & "'velocity_z' in a scene of dimension 2|a/b.nml:5|no direction z")
    call expect_fault(error, base//'&initial displacement_gradient = 1 0 1 /', &
      & "'displacement_gradient' has elements outside")
    call expect_fault(error, base//"&initial file = 'no.txt' /", &
      & "cannot find the file 'no.txt'|a/b.nml:5|a/no.txt")
    call expect_fault(error, base//"&region name = 'r' shape = 'box' lower = 0 /&initial "// &
      & "file = 'no.txt' region = 'r' /", "'file' and 'region' are both given")
  end subroutine test_initial

  subroutine test_boundaries(error)
    type(error_type), allocatable, intent(out) :: error
    call expect_fault(error, base//'&boundary displacement_x = 0 /', "'side' or 'region'|a/b.nml:5")
    call expect_fault(error, base//"&boundary side = 'x_min' /", '&boundary imposes nothing')
    call expect_fault(error, base//"&boundary side = 'z_min' displacement_x = 0 /", &
      & "side 'z_min' in a scene of dimension 2")
    call expect_fault(error, base//"&boundary side = 'x_min' velocity_z = 0 /", &
      & "'velocity_z' in a scene of dimension 2")
    call expect_fault(error, base//"&boundary side = 'x_min' velocity_x = 0 displacement_x = 0 /", &
      & "'displacement_x' and 'velocity_x' are both imposed")
    call expect_fault(error, base//"&boundary side = 'x_min' region = 'r' velocity_x = 0 /", &
      & "'side' and 'region' are both given")
    call expect_fault(error, good_head//go//"&region name = 'r' shape = 'box' lower = 0 /"// &
      & "&boundary body = 'plate' region = 'r' velocity_x = 0 /", "'body' and 'region' are both")
    call expect_fault(error, base//"&boundary side = 'x_min' velocity_x = 0 /"//line// &
      & "&boundary side = 'x_min' velocity_y = 0 /", "side 'x_min' has a layer already|a/b.nml:6")
  end subroutine test_boundaries

  subroutine test_loads(error)
    type(error_type), allocatable, intent(out) :: error
    call expect_fault(error, base//'&load force_x = 0 /', "'side' or 'region'|a/b.nml:5")
    call expect_fault(error, base//"&load side = 'x_min' /", '&load loads nothing')
    call expect_fault(error, base//"&load side = 'x_min' force_z = 1 /", "'force_z' in a scene of")
    call expect_fault(error, base//"&load side = 'x_min' body_force_z = 1 /", "'body_force_z' in a")
    call expect_fault(error, base//"&region name = 'r' shape = 'box' lower = 0 /&load region = "// &
      & "'r' pressure = 1 /", "'pressure' with a region|a/b.nml:5")
    call expect_fault(error, good_head//'&body lower = 2 0 upper = 3 1 points = 100 100 /'//go// &
      & "&load side = 'x_min' pressure = 1 /", "&load lacks the key 'body'|2 bodies")
  end subroutine test_loads

  subroutine test_courses(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: load = base//"&load side = 'x_min' pressure = 1 "
    character(*), parameter :: still = scene_2d//soft//square//"&time method = 'relaxation' /"
    type(scene_type) :: scene

    call expect_fault(error, load//'times = 0 1 /', "'times' without 'values'|a/b.nml:5")
    call expect_fault(error, load//'values = 0 1 /', "'values' without 'times'")
    call expect_fault(error, load//'times = 0 1 values = 0 1 2 /', 'differ in length|2 times, 3')
    call expect_fault(error, load//'times = 0 1 1 values = 0 1 2 /', "'times' do not increase")
    call expect_fault(error, load//'times = 0 1 values = 0 1 ramp_time = 1 /', &
      & "'ramp_time' and 'times' are both given")
    call expect_fault(error, still//"&load side = 'x_min' pressure = 1 times = 0 2 values "// &
      & "= 0 1 /", "the time 2 of 'times' is never reached|a/b.nml:4|from 0 to 1")
    call expect_fault(error, still//"&boundary side = 'x_min' displacement_x = 1 ramp_time = 3 /", &
      & "the ramp does not end|a/b.nml:4|from 0 to 1")
    call expect_fault(error, still//'&initial temperature_change = 1 ramp_time = 3 /', &
      & "the ramp does not end|a/b.nml:4|from 0 to 1")
    call expect_fault(error, still//'&initial velocity_x = 1 ramp_time = 1 /', &
      & 'a course in time without a temperature_change|a/b.nml:4')
    call expect_scene(error, load//'times = 0 1 values = 0 1e-40 /', scene)
    if (allocated(error)) return
    call check(error, abs(scene%loads(1)%values(2)) <= 0.0_wp, 'a tiny number of a table is not 0')
    if (allocated(error)) return
    call expect_scene(error, still//'&initial temperature_change = 1 /', scene)
    if (allocated(error)) return
    call check(error, scene%initial(1)%ramp_time, 1.0_wp)
  end subroutine test_courses

  subroutine test_clouds(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    integer :: unit
    character(*), parameter :: path = 'test_scene_content_check.txt'
    character(*), parameter :: cloud = scene_2d//soft//"&body file = '"//path//"' /"//line//go

    call expect_fault(error, scene_2d//soft//"&body file = 'none.txt' /"//go, &
      & "cannot find the file 'none.txt'|a/b.nml:3|a/none.txt")
    if (allocated(error)) return
    open (newunit=unit, file=path, action='write', status='replace')
    write (unit, '(a)') '0 0 0 1'
    call expect_scene(error, cloud, scene)
    call expect_fault(error, cloud//"&boundary side = 'x_min' displacement_x = 0 /", &
      & "a 'side' of a body that is a cloud|a/b.nml:5|region")
    call expect_fault(error, cloud//"&load side = 'x_min' pressure = 0 /", 'that is a cloud')
    call expect_fault(error, scene_2d//soft//"&body file = '"//path//"' lower = 0 0 /"//go, &
      & 'a lattice or a cloud, not both|a/b.nml:3')
    close (unit, status='delete')
  end subroutine test_clouds

  subroutine test_probes(error)
    type(error_type), allocatable, intent(out) :: error
    call expect_fault(error, base//"&probe name = 'p' point = 1 /", "'point' has too few values")
    call expect_fault(error, base//"&probe name = 'p' point = 1 1 1 /", "'point' has too many")
  end subroutine test_probes

  subroutine test_filled(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    call expect_scene(error, good_head//"&time method = 'relaxation' /&load side = 'x_max' "// &
      & "pressure = 1 /&boundary side = 'x_min' displacement_x = 1 /", scene)
    if (allocated(error)) return
    call check(error, scene%loads(1)%ramp_time, 1.0_wp)
    if (allocated(error)) return
    call check(error, scene%boundaries(1)%ramp_time, 1.0_wp)
    if (allocated(error)) return
    call check(error, trim(scene%loads(1)%body), 'plate')
    if (allocated(error)) return
    call check(error, trim(scene%boundaries(1)%body), '')
  end subroutine test_filled

  subroutine test_memory(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(scene_error), allocatable :: found

    allocate (scene%bodies(1), scene%materials(1))
    scene%header%dimension = 1
    scene%materials(1)%youngs_modulus = 1.0_wp
    scene%materials(1)%density = 1.0_wp
    scene%bodies(1)%lower(1) = 0.0_wp
    scene%bodies(1)%points(1) = 3
    scene%time%steps = 5
    call check_scene(scene, found)
    call expect_parts(error, found, "&body lacks the key 'upper'|group &body number 1, key upper")
    if (allocated(error)) return
    scene%bodies(1)%upper(1) = 1.0_wp
    call check_scene(scene, found)
    call check(error,.not. allocated(found), 'a good scene was refused')
    if (allocated(error)) return
    call check(error, size(scene%cracks), 0)
  end subroutine test_memory

end module test_scene_content_check
