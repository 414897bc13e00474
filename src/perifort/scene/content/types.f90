!> What the user asked for: one type per namelist group, every component with its default and unit.
!>
!> Pure data. Whoever builds a scene without a file fills these types directly.
module pd_scene_content_types
  use pd_base_kinds, only: wp
  use pd_scene_format_given, only: is_set, name_length, path_length, unset
  implicit none (type, external)
  private
  public :: scene_type, header_type, body_group, shape_group, material_group, horizon_group, &
    & crack_group, initial_group, boundary_group, load_group, time_group, relaxation_group, &
    & output_group, probe_group, study_group, name_length, path_length, unset, is_set

  !> `&scene`
  type :: header_type
    character(path_length) :: title = ''
    integer :: dimension = 0                     !! 1, 2 or 3
    character(name_length) :: plane = 'stress'   !! 2D: 'stress' or 'strain'
    real(wp) :: thickness = 1.0_wp               !! 2D: h [m]
    real(wp) :: area = 1.0_wp                    !! 1D: cross section A [m2]
    character(name_length) :: precision = 'double' !! of bonds: 'double' or 'mixed'
  end type header_type

  !> `&body`
  type :: body_group
    character(name_length) :: name = ''
    character(name_length) :: material = ''      !! '' = the only material
    real(wp) :: lower(3) = unset                 !! corner of the lattice's box [m]
    real(wp) :: upper(3) = unset                 !! opposite corner [m]
    integer :: points(3) = 0                     !! points along each direction
    character(path_length) :: file = ''          !! cloud: columns x y z volume
  end type body_group

  !> `&remove`, `&region`, and the shape keys of `&no_fail`
  type :: shape_group
    character(name_length) :: name = ''          !! `&region` only
    character(name_length) :: region = ''        !! `&no_fail` only: instead of a shape
    character(name_length) :: shape = ''         !! 'box', 'sphere', 'cylinder'
    real(wp) :: lower(3) = unset                 !! box, cylinder's ends: unset = unbounded [m]
    real(wp) :: upper(3) = unset                 !! [m]
    real(wp) :: centre(3) = 0.0_wp               !! sphere, cylinder [m]
    real(wp) :: radius = unset                   !! sphere, cylinder [m]
    character(name_length) :: axis = 'z'         !! cylinder: 'x', 'y', 'z'
  end type shape_group

  !> `&material`
  type :: material_group
    character(name_length) :: name = ''
    character(name_length) :: model = 'state_based'        !! or 'bond_based'
    real(wp) :: youngs_modulus = unset                     !! E [Pa]
    real(wp) :: poissons_ratio = unset                     !! nu [-]
    logical :: ignore_poissons_ratio = .false.             !! bond-based with another nu: accept
    real(wp) :: density = unset                            !! rho [kg/m3]
    real(wp) :: critical_stretch = unset                   !! s_c [-]
    real(wp) :: critical_energy_release_rate = unset       !! Gc [J/m2]
    logical :: break_in_compression = .false.
    real(wp) :: thermal_expansion = 0.0_wp                 !! alpha [1/K]
  end type material_group

  !> `&horizon`
  type :: horizon_group
    real(wp) :: ratio = 3.015_wp                           !! delta over the largest spacing [-]
    real(wp) :: length = unset                             !! delta [m], instead of ratio
    character(name_length) :: volume_correction = 'linear' !! 'linear_extended', 'exact', 'none'
    character(name_length) :: surface_correction = 'energy'!! 'none'
    character(name_length) :: dilatation = 'unprojected'   !! 'projected': Lambda as printed
    character(name_length) :: family = 'automatic'         !! 'lattice', 'list'
  end type horizon_group

  !> `&crack`: a segment (2D), a parallelogram or a disc (3D)
  type :: crack_group
    real(wp) :: from(3) = unset
    real(wp) :: to(3) = unset
    real(wp) :: corner(3) = unset
    real(wp) :: edge_1(3) = unset
    real(wp) :: edge_2(3) = unset
    real(wp) :: centre(3) = unset
    real(wp) :: normal(3) = unset
    real(wp) :: radius = unset
  end type crack_group

  !> `&initial`
  type :: initial_group
    character(name_length) :: region = ''        !! '' = all points
    real(wp) :: displacement(3) = unset          !! displacement_x, _y, _z [m]
    real(wp) :: velocity(3) = unset              !! velocity_x, _y, _z [m/s]
    real(wp) :: displacement_gradient(3, 3) = 0.0_wp  !! H(i,j) = du_i/dx_j [-]
    real(wp) :: velocity_gradient(3, 3) = 0.0_wp      !! [1/s]
    real(wp) :: temperature_change = unset       !! [K]
    real(wp) :: ramp_time = unset                !! of the temperature change [s]
    real(wp), allocatable :: times(:)            !! of the temperature change [s]
    real(wp), allocatable :: values(:)           !! factors at `times` [-]
    character(path_length) :: file = ''          !! a table of columns, a row per point
  end type initial_group

  !> `&boundary`
  type :: boundary_group
    character(name_length) :: name = ''
    character(name_length) :: body = ''          !! '' = all bodies together
    character(name_length) :: side = ''          !! 'x_min' .. 'z_max': adds a layer
    character(name_length) :: region = ''        !! existing points instead
    real(wp) :: displacement(3) = unset          !! imposed, unset = free [m]
    real(wp) :: velocity(3) = unset              !! imposed, unset = free [m/s]
    real(wp) :: ramp_time = unset                !! [s]
    real(wp), allocatable :: times(:)            !! [s]
    real(wp), allocatable :: values(:)           !! factors at `times` [-]
  end type boundary_group

  !> `&load`
  type :: load_group
    character(name_length) :: body = ''
    character(name_length) :: side = ''
    character(name_length) :: region = ''
    real(wp) :: pressure = unset                 !! [Pa], positive pushes
    real(wp) :: force(3) = unset                 !! total over the points: force_x, _y, _z [N]
    real(wp) :: body_force(3) = unset            !! density: body_force_x, _y, _z [N/m3]
    real(wp) :: ramp_time = unset                !! [s]
    real(wp), allocatable :: times(:)            !! [s]
    real(wp), allocatable :: values(:)           !! factors at `times` [-]
  end type load_group

  !> `&time`
  type :: time_group
    character(name_length) :: method = 'explicit'             !! 'relaxation'
    character(name_length) :: integrator = 'forward_backward'
    real(wp) :: step = unset                     !! [s], instead of safety
    real(wp) :: safety = 0.8_wp                  !! fraction of the limit [-]
    character(name_length) :: limit = 'equation' !! 7.25, or 'spectral'
    integer :: steps = 0
    real(wp) :: duration = unset                 !! [s], instead of steps
    character(name_length) :: breaking = 'before_forces'      !! 'after_forces'
  end type time_group

  !> `&relaxation`
  type :: relaxation_group
    character(name_length) :: solver = 'conjugate_gradient'      !! 'dynamic_relaxation'
    character(name_length) :: density_matrix = 'frame_invariant' !! 'chapter', 'constant'
    real(wp) :: safety = unset                   !! on the mass; 1, or 5 for 'chapter', 'constant'
    real(wp) :: tolerance = 1.0e-6_wp            !! of residual force and of displacement change [-]
    integer :: maximum_iterations = 100000       !! of each relaxation
    integer :: load_steps = 1
  end type relaxation_group

  !> `&output`
  type :: output_group
    integer :: every = 0                         !! steps (load steps in relaxation); 0 = steps/10
    real(wp) :: interval = unset                 !! [s], instead of every
    integer :: history_every = 0                 !! 0 = by their cost, at most about 2000
    character(name_length), allocatable :: fields(:)
    character(name_length) :: precision = 'double'   !! 'single'
    character(name_length) :: format = 'vtkhdf'      !! 'vtu', 'both'
    integer :: checkpoint_every = 0              !! steps (relaxation: iterations); 0 = none so
    real(wp) :: checkpoint_minutes = 15.0_wp     !! of wall time; 0 = not by time
  end type output_group

  !> `&probe`
  type :: probe_group
    character(name_length) :: name = ''
    real(wp) :: point(3) = unset                 !! [m]
    character(name_length), allocatable :: fields(:)
  end type probe_group

  !> `&study`: one key that a study varies; what is measured stands in the first group that says so.
  type :: study_group
    character(name_length) :: vary = ''          !! `group%key`, `group(2)%key`, `key(1)`, ...
    character(path_length), allocatable :: values(:)  !! as written, texts with their quotes
    logical :: together = .false.                !! in step with the group before
    character(name_length) :: measure = ''       !! a probe, a column of the history or a field
    character(path_length) :: against = ''       !! 'analytic', 'finest' or the name of a file
    character(name_length) :: analytic = ''      !! name of a closed form; '' = the one that fits
    character(name_length) :: norm = ''          !! '' = 'relative'
    character(name_length) :: region = ''        !! a field is measured here; '' = all body points
  end type study_group

  !> Everything a scene file says.
  type :: scene_type
    character(:), allocatable :: file            !! where it was read from ('' = built in memory)
    character(:), allocatable :: text            !! the file's text
    type(header_type) :: header
    type(body_group), allocatable :: bodies(:)
    type(shape_group), allocatable :: removed(:)
    type(shape_group), allocatable :: regions(:)
    type(material_group), allocatable :: materials(:)
    type(horizon_group) :: horizon
    type(crack_group), allocatable :: cracks(:)
    type(shape_group), allocatable :: no_fail(:)
    type(initial_group), allocatable :: initial(:)
    type(boundary_group), allocatable :: boundaries(:)
    type(load_group), allocatable :: loads(:)
    type(time_group) :: time
    type(relaxation_group) :: relaxation
    type(output_group) :: output
    type(probe_group), allocatable :: probes(:)
    type(study_group), allocatable :: studies(:)
  end type scene_type

end module pd_scene_content_types
