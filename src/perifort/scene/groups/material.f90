!> The group `&material`: how bonds carry force and when they break.
module pd_scene_groups_material
  use pd_base_kinds, only: wp
  use pd_base_text, only: join
  use pd_law_influence, only: influence_names
  use pd_law_law, only: parameter_type
  use pd_law_laws, only: all_laws, law_table_type
  use pd_scene_format_given, only: name_length, unset
  use pd_scene_format_keys, only: keys_type
  use pd_scene_groups_group, only: group_type
  implicit none (type, external)
  private
  public :: material_group, critical_names

  !> How the critical stretch follows from Gc.
  character(name_length), parameter :: critical_names(2) = [character(name_length) :: 'lattice', &
    & 'chapter']

  !> `&material`
  type, extends(group_type) :: material_group
    character(name_length) :: name = ''
    character(name_length) :: model = 'state_based'        !! name of a bond law
    character(name_length) :: influence = ''               !! '': that of the law
    real(wp) :: youngs_modulus = unset                     !! E [Pa]
    real(wp) :: poissons_ratio = unset                     !! nu [-]
    logical :: ignore_poissons_ratio = .false.             !! bond-based with another nu: accept
    real(wp) :: density = unset                            !! rho [kg/m3]
    real(wp) :: critical_stretch = unset                   !! s_c [-]
    real(wp) :: critical_energy_release_rate = unset       !! Gc [J/m2]
    character(name_length) :: critical = ''                !! how s_c follows from Gc; '': not said
    real(wp) :: scatter = unset                            !! Weibull modulus [-]
    integer :: seed = 1                                    !! of the scatter
    logical :: break_in_compression = .false.
    real(wp) :: thermal_expansion = 0.0_wp                 !! alpha [1/K]
    type(parameter_type), allocatable :: parameters(:)     !! keys of single laws
  contains
    procedure :: visit
  end type material_group

contains

  !> The keys of the group.
  subroutine visit(group, keys)
    class(material_group), intent(inout) :: group  !! its components are read or shown
    type(keys_type), intent(inout) :: keys         !! the visitor: reads, describes, writes
    type(law_table_type) :: laws
    integer :: i

    laws = all_laws()
    if (.not. allocated(group%parameters)) group%parameters = laws%parameters()
    call keys%key('name', group%name, 'name of the material', word=.true.)
    call keys%key('model', group%model, 'law of the bonds: '//join(laws%names(), ', ')// &
      & "; bond_based and softening hold for one Poisson's ratio only", word=.true.)
    call keys%key('influence', group%influence, 'influence function omega(|xi|): delta/|xi|, '// &
      & '1, 1 - |xi|/delta or exp(-(|xi|/delta)^2)', allowed=influence_names, &
      & default="lps: 'constant'; lps_plastic, lps_plastic_large: 'linear'; else 'inverse'")
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
    call keys%key('critical', group%critical, 'how the critical stretch follows from Gc: a '// &
      & 'crack grows through the lattice at Gc, or the formula of the chapter', &
      & allowed=critical_names, default="'lattice', where it can be had")
    call keys%key('scatter', group%scatter, '-', 'Weibull modulus of the critical stretches '// &
      & 'of bonds, whose mean is the given one', above=0.0_wp, default='none: all are equal')
    call keys%key('seed', group%seed, '', 'of the random numbers of scatter', at_least=0)
    call keys%key('break_in_compression', group%break_in_compression, 'bonds break at the '// &
      & 'critical stretch in compression too')
    call keys%key('thermal_expansion', group%thermal_expansion, '1/K', &
      & 'coefficient of linear thermal expansion alpha')
    do i = 1, size(group%parameters)
      associate (own => group%parameters(i))
        if (own%zero) then
          call keys%key(trim(own%name), own%value, trim(own%unit), trim(own%meaning), &
            & at_least=0.0_wp)
        else
          call keys%key(trim(own%name), own%value, trim(own%unit), trim(own%meaning), above=0.0_wp)
        end if
      end associate
    end do
  end subroutine visit

end module pd_scene_groups_material
