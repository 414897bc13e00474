!> Every group and key of a scene file, declared once.
!>
!> Each `visit_...` names the keys of one group in the order in which the reference lists them.
!> Defaults are those of the types in `pd_scene_content_types`.
module pd_scene_content_groups
  use pd_base_kinds, only: wp
  use pd_base_error, only: internal_fault
  use pd_scene_format_keys, only: keys_type, mode_describe, mode_write
  use pd_scene_content_types, only: header_type, body_group, shape_group, material_group, &
    & horizon_group, crack_group, initial_group, boundary_group, load_group, time_group, &
    & relaxation_group, output_group, probe_group, study_group, is_set
  implicit none (type, external)
  private
  public :: visit_scene_header, visit_body, visit_remove, visit_region, visit_material, &
    & visit_horizon, visit_crack, visit_no_fail, visit_initial, visit_boundary, visit_load, &
    & visit_time, visit_relaxation, visit_output, visit_probe, visit_study
  public :: group_names, shape_names, sides, default_fields, default_probe_fields, &
    & closed_forms
  public :: group_repeatable, group_purpose, describe_group

  character(10), parameter :: group_names(16) = [character(10) :: 'scene', 'body', 'remove', &
    & 'region', 'material', 'horizon', 'crack', 'no_fail', 'initial', 'boundary', 'load', 'time', &
    & 'relaxation', 'output', 'probe', 'study']  !! in the order of the reference

  !> The fields written if none are named.
  character(14), parameter :: default_fields(3) = [character(14) :: 'displacement', 'velocity', &
    & 'damage']
  !> The fields probed if none are named.
  character(14), parameter :: default_probe_fields(1) = [character(14) :: 'displacement']
  !> Sides of a body.
  character(5), parameter :: sides(6) = [character(5) :: 'x_min', 'x_max', 'y_min', 'y_max', &
    & 'z_min', 'z_max']
  !> Kinds of shapes.
  character(8), parameter :: shape_names(3) = [character(8) :: 'box', 'sphere', 'cylinder']
  !> Answers that a study knows in closed form.
  character(15), parameter :: closed_forms(6) = [character(15) :: 'bar_vibration', 'bar_tension', &
    & 'uniaxial_stress', 'plate_hole', 'chain_wave', 'linear_field']
  character(1), parameter :: axes(3) = ['x', 'y', 'z']

contains

  !> Whether a group may be given more than once.
  pure logical function group_repeatable(name) result(repeatable)
    character(*), intent(in) :: name

    select case (name)
    case ('scene', 'horizon', 'time', 'relaxation', 'output')
      repeatable = .false.
    case ('body', 'remove', 'region', 'material', 'crack', 'no_fail', 'initial', 'boundary', &
      & 'load', 'probe', 'study')
      repeatable = .true.
    case default
      repeatable = .false.
      call internal_fault('group_repeatable does not know the group '//name)
    end select
  end function group_repeatable

  !> What a group is for, in one or two sentences.
  pure function group_purpose(name) result(purpose)
    character(*), intent(in) :: name
    character(:), allocatable :: purpose

    select case (name)
    case ('scene')
      purpose = 'The problem as a whole: its title, its dimension and what that takes for granted.'
    case ('body')
      purpose = 'Material points: a lattice that fills a box, or a cloud read from a file.'
    case ('remove')
      purpose = 'A shape cut out of the bodies: points whose centres lie inside it are left out.'
    case ('region')
      purpose = 'A named shape; other groups use the points inside it by its name.'
    case ('material')
      purpose = 'A material: how its bonds carry force and when they break.'
    case ('horizon')
      purpose = 'How far points interact, and how the sums over families are corrected.'
    case ('crack')
      purpose = 'A crack that is there from the start: a segment in 2D (from, to); in 3D '// &
        & 'a parallelogram (corner, edge_1, edge_2) or a disc (centre, normal, radius).'
    case ('no_fail')
      purpose = 'A zone where no bond breaks: a region by its name, or a shape.'
    case ('initial')
      purpose = 'The state at the start, of all points or of a region. The groups are applied '// &
        & 'in order, each setting what it names.'
    case ('boundary')
      purpose = 'Imposed motion of a layer added outside a side, or of a region. '// &
        & 'Components not named stay free.'
    case ('load')
      purpose = 'A force on the outermost points of a side of a body, or on a region.'
    case ('time')
      purpose = 'How the state moves: explicit steps in time, or relaxation to static equilibrium.'
    case ('relaxation')
      purpose = "How static equilibrium is found (time method = 'relaxation')."
    case ('output')
      purpose = 'What is written, and how often.'
    case ('probe')
      purpose = 'The values of the nearest point in every row of the history.'
    case ('study')
      purpose = 'A key that `perifort study` and `choose` vary. Several groups make the '// &
        & 'product of their values; what is measured has to be given in one of them only. '// &
        & '`run` ignores it.'
    case default
      purpose = ''
      call internal_fault('group_purpose does not know the group '//name)
    end select
  end function group_purpose

  !> Let `keys` know all keys of a group with their defaults.
  subroutine describe_group(keys, name)
    type(keys_type), intent(inout) :: keys
    character(*), intent(in) :: name
    type(header_type) :: header
    type(body_group) :: body
    type(shape_group) :: shape
    type(material_group) :: material
    type(horizon_group) :: horizon
    type(crack_group) :: crack
    type(initial_group) :: initial
    type(boundary_group) :: boundary
    type(load_group) :: load
    type(time_group) :: time
    type(relaxation_group) :: relaxation
    type(output_group) :: output
    type(probe_group) :: probe
    type(study_group) :: study

    call keys%start(mode_describe)
    select case (name)
    case ('scene')
      call visit_scene_header(keys, header)
    case ('body')
      call visit_body(keys, body)
    case ('remove')
      call visit_remove(keys, shape)
    case ('region')
      call visit_region(keys, shape)
    case ('material')
      call visit_material(keys, material)
    case ('horizon')
      call visit_horizon(keys, horizon)
    case ('crack')
      call visit_crack(keys, crack)
    case ('no_fail')
      call visit_no_fail(keys, shape)
    case ('initial')
      call visit_initial(keys, initial)
    case ('boundary')
      call visit_boundary(keys, boundary)
    case ('load')
      call visit_load(keys, load)
    case ('time')
      call visit_time(keys, time)
    case ('relaxation')
      call visit_relaxation(keys, relaxation)
    case ('output')
      call visit_output(keys, output)
    case ('probe')
      call visit_probe(keys, probe)
    case ('study')
      call visit_study(keys, study)
    case default
      call internal_fault('describe_group does not know the group '//name)
    end select
  end subroutine describe_group

  !> `&scene`
  subroutine visit_scene_header(keys, group)
    type(keys_type), intent(inout) :: keys
    type(header_type), intent(inout) :: group

    call keys%key('title', group%title, 'what the scene shows')
    call keys%key('dimension', group%dimension, '', 'number of directions', required=.true., &
      & at_least=1, at_most=3)
    call keys%key('plane', group%plane, '2D: plane stress or plane strain', &
      & allowed=[character(6) :: 'stress', 'strain'])
    call keys%key('thickness', group%thickness, 'm', '2D: thickness h', above=0.0_wp)
    call keys%key('area', group%area, 'm2', '1D: cross section A', above=0.0_wp)
    call keys%key('precision', group%precision, 'of the bonds: mixed computes them in single '// &
      & 'precision, from a state in double precision (lattice families)', &
      & allowed=[character(6) :: 'double', 'mixed'])
  end subroutine visit_scene_header

  !> `&body`
  subroutine visit_body(keys, group)
    type(keys_type), intent(inout) :: keys
    type(body_group), intent(inout) :: group

    call keys%key('name', group%name, 'name of the body', word=.true.)
    call keys%key('material', group%material, 'name of its material', default='the only material')
    call keys%key('lower', group%lower, 'm', 'lattice: lower corner of the box that the cells fill')
    call keys%key('upper', group%upper, 'm', 'lattice: upper corner')
    call keys%key('points', group%points, '', 'lattice: points along each direction, at the '// &
      & 'centres of cubic cells', at_least=1)
    call keys%key('file', group%file, 'cloud instead of a lattice: a text file with the '// &
      & "columns x y z volume, '#' starts a comment")
  end subroutine visit_body

  !> `&remove`
  subroutine visit_remove(keys, group)
    type(keys_type), intent(inout) :: keys
    type(shape_group), intent(inout) :: group

    call visit_shape(keys, group, required=.true.)
  end subroutine visit_remove

  !> `&region`
  subroutine visit_region(keys, group)
    type(keys_type), intent(inout) :: keys
    type(shape_group), intent(inout) :: group

    call keys%key('name', group%name, 'name used elsewhere', required=.true., word=.true.)
    call visit_shape(keys, group, required=.true.)
  end subroutine visit_region

  !> `&no_fail`
  subroutine visit_no_fail(keys, group)
    type(keys_type), intent(inout) :: keys
    type(shape_group), intent(inout) :: group

    call keys%key('region', group%region, 'name of a region, instead of a shape')
    call visit_shape(keys, group, required=.false.)
  end subroutine visit_no_fail

  !> The keys of a shape.
  subroutine visit_shape(keys, group, required)
    type(keys_type), intent(inout) :: keys
    type(shape_group), intent(inout) :: group
    logical, intent(in) :: required
    logical :: plain

    ! Written: only keys that the kind of shape has. Reading starts before the kind is known.
    plain = keys%mode == mode_write .and. group%shape /= 'sphere' .and. group%shape /= 'cylinder'
    call keys%key('shape', group%shape, 'kind of shape; in 2D a sphere is a circle', &
      & required=required, allowed=shape_names)
    call keys%key('lower', group%lower, 'm', 'box: lower corner; cylinder: its lower end along '// &
      & 'the axis', default='unbounded')
    call keys%key('upper', group%upper, 'm', 'box: upper corner; cylinder: its upper end along '// &
      & 'the axis', default='unbounded')
    call keys%key('centre', group%centre, 'm', 'sphere: centre; cylinder: a point of the axis', &
      & hidden=plain)
    call keys%key('radius', group%radius, 'm', 'sphere, cylinder: radius', above=0.0_wp)
    call keys%key('axis', group%axis, 'cylinder: direction of the axis', allowed=axes, &
      & hidden=keys%mode == mode_write .and. group%shape /= 'cylinder')
  end subroutine visit_shape

  !> `&material`
  subroutine visit_material(keys, group)
    type(keys_type), intent(inout) :: keys
    type(material_group), intent(inout) :: group

    call keys%key('name', group%name, 'name of the material', word=.true.)
    call keys%key('model', group%model, 'law of the bonds; bond_based holds for one '// &
      & "Poisson's ratio only", allowed=[character(11) :: 'state_based', 'bond_based'])
    call keys%key('youngs_modulus', group%youngs_modulus, 'Pa', "Young's modulus E", &
      & required=.true., above=0.0_wp)
    call keys%key('poissons_ratio', group%poissons_ratio, '-', "Poisson's ratio nu, below 1/2 "// &
      & 'except in plane stress', default='bond_based: 1/4 (3D, plane strain), 1/3 '// &
      & '(plane stress); 1D: 0; else required', above=-1.0_wp, below=1.0_wp)
    call keys%key('ignore_poissons_ratio', group%ignore_poissons_ratio, 'bond_based: accept '// &
      & "another Poisson's ratio and compute with the one that the model has")
    call keys%key('density', group%density, 'kg/m3', 'mass density rho', above=0.0_wp, &
      & default='required; relaxation: not needed (1)')
    call keys%key('critical_stretch', group%critical_stretch, '-', 'stretch at which a bond '// &
      & 'breaks', above=0.0_wp, default='none: bonds never break')
    call keys%key('critical_energy_release_rate', group%critical_energy_release_rate, 'J/m2', &
      & 'energy release rate Gc, instead of critical_stretch', above=0.0_wp)
    call keys%key('break_in_compression', group%break_in_compression, 'bonds break at the '// &
      & 'critical stretch in compression too')
    call keys%key('thermal_expansion', group%thermal_expansion, '1/K', &
      & 'coefficient of linear thermal expansion alpha')
  end subroutine visit_material

  !> `&horizon`
  subroutine visit_horizon(keys, group)
    type(keys_type), intent(inout) :: keys
    type(horizon_group), intent(inout) :: group

    call keys%key('ratio', group%ratio, '-', 'horizon over the largest spacing', at_least=1.0_wp, &
      & hidden=is_set(group%length))
    call keys%key('length', group%length, 'm', 'horizon delta, instead of ratio', above=0.0_wp)
    call keys%key('volume_correction', group%volume_correction, 'volumes of cells that the '// &
      & 'horizon cuts (7.2)', allowed=[character(15) :: 'linear', 'linear_extended', 'exact', &
      & 'none'])
    call keys%key('surface_correction', group%surface_correction, 'correction of points with '// &
      & 'incomplete families (7.7)', allowed=[character(6) :: 'energy', 'none'])
    call keys%key('dilatation', group%dilatation, 'unprojected: Lambda = 1, whatever way parts '// &
      & 'are turned; projected: Lambda as in the book, for small rotations', &
      & allowed=[character(11) :: 'unprojected', 'projected'])
    call keys%key('family', group%family, &
      & 'how families are kept: a lattice where all points lie on grids, else lists; or one of '// &
      & 'them by force', &
      & allowed=[character(9) :: 'automatic', 'lattice', 'list'])
  end subroutine visit_horizon

  !> `&crack`
  subroutine visit_crack(keys, group)
    type(keys_type), intent(inout) :: keys
    type(crack_group), intent(inout) :: group

    call keys%key('from', group%from, 'm', '2D segment: one end')
    call keys%key('to', group%to, 'm', '2D segment: other end')
    call keys%key('corner', group%corner, 'm', '3D parallelogram: a corner')
    call keys%key('edge_1', group%edge_1, 'm', '3D parallelogram: an edge from the corner')
    call keys%key('edge_2', group%edge_2, 'm', '3D parallelogram: the other edge')
    call keys%key('centre', group%centre, 'm', '3D disc: centre')
    call keys%key('normal', group%normal, '-', '3D disc: normal, of any length')
    call keys%key('radius', group%radius, 'm', '3D disc: radius', above=0.0_wp)
  end subroutine visit_crack

  !> `&initial`
  subroutine visit_initial(keys, group)
    type(keys_type), intent(inout) :: keys
    type(initial_group), intent(inout) :: group

    call keys%key('region', group%region, 'name of a region', default='all points')
    call keys%triple('displacement', group%displacement, 'm', 'displacement', '0')
    call keys%triple('velocity', group%velocity, 'm/s', 'velocity', '0')
    call keys%key('displacement_gradient', group%displacement_gradient, '-', &
      & 'H(i,j) = du_i/dx_j: adds H x to the displacement')
    call keys%key('velocity_gradient', group%velocity_gradient, '1/s', &
      & 'G(i,j) = dv_i/dx_j: adds G x to the velocity')
    call keys%key('temperature_change', group%temperature_change, 'K', 'temperature change', &
      & default='0')
    call visit_course(keys, group%ramp_time, group%times, group%values, 'the temperature change ')
    call keys%key('file', group%file, 'a table with a header that names columns among '// &
      & 'displacement_x.., velocity_x.., temperature_change, and a row per point')
  end subroutine visit_initial

  !> `&boundary`
  subroutine visit_boundary(keys, group)
    type(keys_type), intent(inout) :: keys
    type(boundary_group), intent(inout) :: group

    call keys%key('name', group%name, 'with a name, the history has its reaction force', &
      & word=.true.)
    call keys%key('body', group%body, 'side: name of the body', default='all bodies together')
    call keys%key('side', group%side, 'adds a layer as wide as the horizon outside this side', &
      & allowed=sides)
    call keys%key('region', group%region, 'name of a region, instead of side')
    call keys%triple('displacement', group%displacement, 'm', 'imposed displacement', 'free')
    call keys%triple('velocity', group%velocity, 'm/s', 'imposed velocity', 'free')
    call visit_course(keys, group%ramp_time, group%times, group%values)
  end subroutine visit_boundary

  !> `&load`
  subroutine visit_load(keys, group)
    type(keys_type), intent(inout) :: keys
    type(load_group), intent(inout) :: group

    call keys%key('body', group%body, 'side: name of the body', default='the only body')
    call keys%key('side', group%side, 'the outermost points at this side', allowed=sides)
    call keys%key('region', group%region, 'name of a region, instead of side')
    call keys%key('pressure', group%pressure, 'Pa', 'side: pressure, positive pushes')
    call keys%triple('force', group%force, 'N', 'total force over the points', '0')
    call keys%triple('body_force', group%body_force, 'N/m3', 'force density', '0')
    call visit_course(keys, group%ramp_time, group%times, group%values)
  end subroutine visit_load

  !> The course in time of a temperature change, a boundary or a load.
  subroutine visit_course(keys, ramp_time, times, values, subject)
    type(keys_type), intent(inout) :: keys             !! visitor
    real(wp), intent(inout) :: ramp_time               !! length of a ramp from 0 [s]
    real(wp), allocatable, intent(inout) :: times(:)   !! of a table [s]
    real(wp), allocatable, intent(inout) :: values(:)  !! factors at `times` [-]
    character(*), intent(in), optional :: subject      !! what varies, if not all of the group
    character(:), allocatable :: who

    who = ''
    if (present(subject)) who = subject
    call keys%key('ramp_time', ramp_time, 's', who//'grows linearly from 0 during this time', &
      & above=0.0_wp, default='at once; in relaxation 1, the end of the load steps')
    call keys%list('times', times, 's', 'instead of ramp_time: increasing times')
    call keys%list('values', values, '-', 'factors at these times, linear between them')
  end subroutine visit_course

  !> `&time`
  subroutine visit_time(keys, group)
    type(keys_type), intent(inout) :: keys
    type(time_group), intent(inout) :: group

    call keys%key('method', group%method, 'explicit steps in time, or relaxation to '// &
      & 'static equilibrium', allowed=[character(10) :: 'explicit', 'relaxation'])
    call keys%key('integrator', group%integrator, 'explicit: rule of the steps', &
      & allowed=[character(16) :: 'forward_backward', 'velocity_verlet', 'adams_bashforth', &
      & 'adams_moulton', 'runge_kutta'])
    call keys%key('step', group%step, 's', 'time step, instead of safety', above=0.0_wp)
    call keys%key('safety', group%safety, '-', 'the time step as a fraction of the '// &
      & "integrator's limit", above=0.0_wp, hidden=is_set(group%step))
    call keys%key('limit', group%limit, "explicit: the integrator's limit from equation 7.25, "// &
      & 'or from the largest frequency of the body, which is measured at the start', &
      & allowed=[character(8) :: 'equation', 'spectral'])
    call keys%key('steps', group%steps, '', 'number of steps', at_least=1, &
      & default='explicit: steps or duration is required', hidden=group%steps == 0)
    call keys%key('duration', group%duration, 's', 'time to compute, instead of steps', &
      & above=0.0_wp)
    call keys%key('breaking', group%breaking, 'explicit: a bond beyond its limit breaks before '// &
      & "the forces of the step are computed, or after that (as in the book's programs)", &
      & allowed=[character(13) :: 'before_forces', 'after_forces'])
  end subroutine visit_time

  !> `&relaxation`
  subroutine visit_relaxation(keys, group)
    type(keys_type), intent(inout) :: keys
    type(relaxation_group), intent(inout) :: group

    call keys%key('solver', group%solver, 'conjugate_gradient: Newton''s method with conjugate '// &
      & 'gradients; dynamic_relaxation: adaptive, as in the book', &
      & allowed=[character(18) :: 'conjugate_gradient', 'dynamic_relaxation'])
    call keys%key('density_matrix', group%density_matrix, 'fictitious mass of dynamic '// &
      & 'relaxation, scale of conjugate gradients; chapter = 7.32', &
      & allowed=[character(15) :: 'frame_invariant', 'chapter', 'constant'])
    call keys%key('safety', group%safety, '-', 'factor on the fictitious mass', above=0.0_wp, &
      & default='1; 5 for chapter and constant')
    call keys%key('tolerance', group%tolerance, '-', 'converged when residual force and '// &
      & 'displacement change are below this', above=0.0_wp, below=1.0_wp)
    call keys%key('maximum_iterations', group%maximum_iterations, '', 'most iterations of each '// &
      & 'relaxation', at_least=1)
    call keys%key('load_steps', group%load_steps, '', 'steps in which loads and imposed '// &
      & 'displacements grow', at_least=1)
  end subroutine visit_relaxation

  !> `&output`
  subroutine visit_output(keys, group)
    type(keys_type), intent(inout) :: keys
    type(output_group), intent(inout) :: group

    call keys%key('every', group%every, '', 'steps (relaxation: load steps) between outputs', &
      & at_least=1, default='a tenth of the steps; relaxation: 1', hidden=group%every == 0)
    call keys%key('interval', group%interval, 's', 'time between outputs, instead of every', &
      & above=0.0_wp)
    call keys%key('history_every', group%history_every, '', &
      & 'steps between rows of the history (relaxation: iterations between lines of '// &
      & 'iterations.csv)', at_least=1, default='max(1, steps/2000), and so many that rows '// &
      & 'take at most 5 % of the time; relaxation: 1', &
      & hidden=group%history_every == 0)
    call keys%list('fields', group%fields, 'fields to write', keys%field_names(), &
      & default="'displacement', 'velocity', 'damage'")
    call keys%key('precision', group%precision, 'of the fields in the file', &
      & allowed=[character(6) :: 'single', 'double'])
    call keys%key('format', group%format, 'vtkhdf: one HDF5 file, also VTK; vtu: a .pvd series', &
      & allowed=[character(6) :: 'vtkhdf', 'vtu', 'both'])
    call keys%key('checkpoint_every', group%checkpoint_every, '', &
      & 'steps (relaxation: iterations) between checkpoints, from which a run can go on', &
      & at_least=1, default='by time only', hidden=group%checkpoint_every == 0)
    call keys%key('checkpoint_minutes', group%checkpoint_minutes, 'min', &
      & 'minutes of computing between checkpoints; 0: none by time', at_least=0.0_wp)
  end subroutine visit_output

  !> `&probe`
  subroutine visit_probe(keys, group)
    type(keys_type), intent(inout) :: keys
    type(probe_group), intent(inout) :: group

    call keys%key('name', group%name, 'start of its column names', required=.true., word=.true.)
    call keys%key('point', group%point, 'm', 'position; the nearest point is taken', &
      & required=.true.)
    call keys%list('fields', group%fields, 'fields to note', keys%field_names(), &
      & default="'displacement'")
  end subroutine visit_probe

  !> `&study`
  subroutine visit_study(keys, group)
    type(keys_type), intent(inout) :: keys
    type(study_group), intent(inout) :: group

    call keys%key('vary', group%vary, 'the key that is varied: group%key, or key alone where '// &
      & 'it is the only one of its name; group(2)%key where a group is repeated, key(2) for an '// &
      & 'element', required=.true.)
    call keys%words('values', group%values, 'its values, one for each run; of body%points the '// &
      & 'count along x, the other counts follow in proportion', required=.true.)
    call keys%key('together', group%together, 'varies together with the group before it '// &
      & 'instead of making the product')
    call keys%key('measure', group%measure, 'a probe, a column of the history, or a field in '// &
      & 'the final state', default='required in one group')
    call keys%key('against', group%against, 'what it is compared with: analytic, a closed '// &
      & 'form; finest, the run that is the finest in every varied key; or the name of a file, '// &
      & 'history.csv, '// &
      & 'a table of positions and values, or results (.vtkhdf)', default='required in one group')
    call keys%key('analytic', group%analytic, 'the closed form', allowed=closed_forms, &
      & default='the one that fits the scene')
    call keys%key('norm', group%norm, 'root mean square of the differences, the largest, or '// &
      & "the root of their squares over the answer's", &
      & allowed=[character(8) :: 'rms', 'maximum', 'relative'], default="'relative'")
    call keys%key('region', group%region, 'field: name of a region whose points count', &
      & default='all points of the bodies')
  end subroutine visit_study

end module pd_scene_content_groups
